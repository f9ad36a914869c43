# zsh -f complete.zsh FOLDER LINE: prints what an interactive zsh offers at the end of the line, a word a line.
# FOLDER holds the completion as the file _quadruped3d, as a folder of $fpath does.
#
# The zsh that completes runs on a terminal of its own. There, compadd, which all completions end in, prints the
# words that fit between two marks.
zmodload zsh/zpty
setup=$(mktemp)
trap 'rm -f $setup' EXIT
cat >$setup <<'SETUP'
PROMPT=
unsetopt zle_bracketed_paste 2>/dev/null
zstyle ':completion:*' insert-tab false
zstyle ':completion:*' menu no
autoload -Uz compinit
compinit -u -D
mark_start() { print -r -- "<offers>" }
mark_end() { print -r -- "</offers>" }
compprefuncs=(mark_start)
comppostfuncs=(mark_end)
compadd() {
  # Calls that only ask, or store what fits, offer nothing themselves.
  if [[ ${@[(i)-[ADO]]} -le $# ]]; then
    builtin compadd "$@"
    return
  fi
  local -a fit
  builtin compadd -A fit "$@"
  local word
  for word in $fit; do print -r -- "offer:$word"; done
  builtin compadd "$@"
}
bindkey '^I' complete-word
print -r -- "<ready>"
SETUP
zpty shell "TERM=dumb COLUMNS=200 zsh -f -i"
zpty -w shell "fpath=(${(q)1} \$fpath); source ${(q)setup}"
text=
while zpty -r shell line; do
  [[ $line == *'<ready>'* && $line != *print* ]] && break
done
zpty -n -w shell "$2"$'\t'
while zpty -r shell line; do
  line=${line%%[$'\r\n']*}
  [[ $line == *'offer:'* ]] && print -r -- "${line##*offer:}"
  [[ $line == *'</offers>'* ]] && break
done
zpty -d shell
