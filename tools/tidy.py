"""Runs clang-tidy on the sources that changed and prints each finding once; tools/tidy.sh says how it is called."""

from __future__ import annotations

import concurrent.futures
import functools
import hashlib
import json
import os
import pathlib
import re
import shlex
import shutil
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parents[1]
BUILD = ROOT / os.environ.get("BUILD", "build/release")
JOBS = int(os.environ.get("JOBS") or os.cpu_count() or 1)
CACHE = pathlib.Path(os.environ.get("XDG_CACHE_HOME") or pathlib.Path.home() / ".cache") / "quadruped3d-tidy"
FINDING = re.compile(r"^(?P<place>[^\s:][^:]*:\d+:\d+): (?:warning|error): (?P<text>.*)$", re.MULTILINE)
COMPILER = re.compile(r"(^|/)([a-z0-9_-]+-)?(cc|c\+\+|gcc|g\+\+|clang|clang\+\+)(-[0-9.]+)?$")
COUNT = re.compile(r"^\d+ warnings?( and \d+ errors?)? (generated|treated as errors?)\.?$")
INCLUDE = re.compile(r'^#include "([^"]+)"', re.MULTILINE)

# Clang knows neither GCC's flag nor its precompiled headers; a warning of Clang is a finding, not an error.
UNKNOWN_TO_CLANG = ("-fno-tree-slp-vectorize", "-Winvalid-pch", "-Werror", "-fpch-preprocess")


def stop(message: str) -> None:
    print(f"tidy: {message}", file=sys.stderr)
    sys.exit(2)


def git(*arguments: str) -> list[str]:
    done = subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True)
    if done.returncode != 0:
        stop(f"git {' '.join(arguments)}: {done.stderr.strip()}")
    return done.stdout.splitlines()


def is_commit(name: str) -> bool:
    command = ["git", "rev-parse", "--verify", "--quiet", f"{name}^{{commit}}"]
    return subprocess.run(command, cwd=ROOT, capture_output=True).returncode == 0


def default_base() -> str:
    if is_commit("origin/main"):
        base = git("merge-base", "HEAD", "origin/main")[0]
        if base != git("rev-parse", "HEAD")[0]:
            return base
    if not is_commit("HEAD~1"):
        stop("the history has one commit only; name what to check: tools/tidy.sh --all")
    return "HEAD~1"


def changed_files(base: str) -> list[str]:
    changed = []
    for line in git("diff", "--name-status", "--find-renames", "--diff-filter=d", base):
        status, *names = line.split("\t")
        if status != "R100":
            changed.append(names[-1])
    return changed + git("ls-files", "--others", "--exclude-standard")


def wanted_files(arguments: list[str]) -> tuple[list[str], str]:
    """The C++ files to check, relative to the root, and in words why these."""
    if arguments == ["--all"]:
        names, why = git("ls-files"), "all sources"
    elif arguments and all(os.path.isfile(name) for name in arguments):
        names, why = [os.path.relpath(os.path.abspath(name), ROOT) for name in arguments], "the given files"
    elif len(arguments) <= 1:
        base = arguments[0] if arguments else default_base()
        if not is_commit(base):
            stop(f"{base} is neither a file nor a commit; see the head of tools/tidy.sh")
        names, why = changed_files(base), f"files that differ from {base[:12]}"
    else:
        stop(f"{' '.join(arguments)}: expected files, or one commit, or --all")
    return sorted({name for name in names if name.endswith((".cpp", ".h"))}), why


def for_clang(entry: dict) -> dict:
    """A compile command without what only GCC understands, the precompiled header, and the compiler's launcher.

    The include roots in the build folder are links to the headers of single rooms. The repository's root stands for
    them, so that a finding names the header where it lies and every header has one name.
    """
    words = shlex.split(entry["command"]) if "command" in entry else entry["arguments"]
    while words and not COMPILER.search(words[0]):
        words = words[1:]
    if not words:
        stop(f"{entry['file']}: no compiler in its command: {entry.get('command', entry.get('arguments'))}")
    kept = [words[0], f"-I{ROOT}"]
    rest = iter(words[1:])
    for word in rest:
        if word == "-include":
            next(rest)
        elif word not in UNKNOWN_TO_CLANG and not word.startswith(f"-I{BUILD}/include/"):
            kept.append(word)
    return {"directory": entry["directory"], "file": entry["file"], "arguments": kept}


@functools.cache
def own_includes(name: str) -> frozenset[str]:
    """The headers of the repository that a file includes, by their names relative to the root."""
    here = os.path.dirname(name)
    candidates = [path for found in INCLUDE.findall((ROOT / name).read_text())
                  for path in (os.path.normpath(os.path.join(here, found)), found)]
    return frozenset(path for path in candidates if (ROOT / path).is_file())


def all_includes(source: str) -> list[str]:
    seen, waiting = set(), [source]
    while waiting:
        name = waiting.pop()
        if name not in seen:
            seen.add(name)
            waiting += own_includes(name)
    return sorted(seen)


def cache_entry(source: str, command: dict, program: str) -> pathlib.Path:
    """A file that is there when just this source was checked before, with these headers, flags and checks, and was
    clean. Paths do not count, so another clone on this machine uses it too."""
    hashed = hashlib.sha256(version_of(program).encode())
    hashed.update((ROOT / ".clang-tidy").read_bytes())
    hashed.update(" ".join(command["arguments"]).replace(str(BUILD), "BUILD").replace(str(ROOT), "ROOT").encode())
    for name in all_includes(source):
        hashed.update(f"\0{name}\0".encode() + (ROOT / name).read_bytes())
    return CACHE / hashed.hexdigest()


@functools.cache
def version_of(program: str) -> str:
    return subprocess.run([program, "--version"], check=True, capture_output=True, text=True).stdout


def compile_commands() -> dict[str, dict]:
    """Of this repository's sources, by their name relative to the root."""
    path = BUILD / "compile_commands.json"
    if not path.exists():
        stop(f"{path} is missing; run `cmake --preset {BUILD.name}` (or `make build`) first")
    commands = {}
    for entry in json.loads(path.read_text()):
        source = os.path.relpath(os.path.join(entry["directory"], entry["file"]), ROOT)
        if not source.startswith("..") and not source.startswith(os.path.relpath(BUILD, ROOT)):
            commands[source] = for_clang(entry)
    return commands


def source_of_header(header: str, commands: dict[str, dict]) -> str | None:
    """A source through which the header is seen: the one beside it, else the first that names it."""
    beside = header[: -len(".h")] + ".cpp"
    if beside in commands:
        return beside
    pattern = re.compile(r'#include "(?:[^"]*/)?' + re.escape(os.path.basename(header)) + '"')
    users = [source for source in sorted(commands) if pattern.search((ROOT / source).read_text())]
    exact = [source for source in users if f'"{header}"' in (ROOT / source).read_text()]
    return (exact or users or [None])[0]


def sources_to_check(files: list[str], commands: dict[str, dict]) -> list[str]:
    sources = set()
    for name in files:
        source = source_of_header(name, commands) if name.endswith(".h") else name
        if source in commands:
            sources.add(source)
        else:
            print(f"tidy: {name} is part of no target of {BUILD.name}, so it is not checked", file=sys.stderr)
    return sorted(sources)


def run_clang_tidy(program: str, source: str, database: pathlib.Path) -> tuple[list[str], int]:
    """The lines that clang-tidy prints, and its exit status."""
    folders = sorted({name.split("/")[0] for name in git("ls-files", "*.h")})
    headers = f"^{re.escape(str(ROOT))}/({'|'.join(folders)})/"
    done = subprocess.run([program, "--quiet", f"--header-filter={headers}", "-p", str(database), str(ROOT / source)],
                          cwd=ROOT, capture_output=True, text=True)
    output = done.stdout if FINDING.search(done.stdout) or done.returncode == 0 else done.stdout + done.stderr
    return output.splitlines(), done.returncode


def findings(lines: list[str]) -> dict[str, str]:
    """Each finding with the lines that belong to it, by its place and text."""
    found: dict[str, str] = {}
    key = None
    for line in lines:
        if COUNT.match(line):
            continue
        match = FINDING.match(line)
        if match:
            key = match["place"] + match["text"]
            line = line.replace(f"{ROOT}/", "", 1)
            found[key] = line
        elif key:
            found[key] += "\n" + line.replace(f"{ROOT}/", "", 1)
    return found


def main(arguments: list[str]) -> int:
    start = time.monotonic()
    program = os.environ.get("CLANG_TIDY") or shutil.which("clang-tidy-14") or shutil.which("clang-tidy")
    if not program:
        stop("clang-tidy is not installed; apt-get install clang-tidy")
    files, why = wanted_files(arguments)
    if not files:
        print(f"tidy: {why}: no C++ file", file=sys.stderr)
        return 0
    commands = compile_commands()
    database = ROOT / BUILD / "tidy"
    database.mkdir(exist_ok=True)
    (database / "compile_commands.json").write_text(json.dumps(list(commands.values()), indent=1))
    sources = sources_to_check(files, commands)
    CACHE.mkdir(parents=True, exist_ok=True)
    entries = {source: cache_entry(source, commands[source], program) for source in sources}
    open_sources = [source for source in sources if not entries[source].exists()]
    seen: set[str] = set()
    failed = False
    with concurrent.futures.ThreadPoolExecutor(JOBS) as pool:
        jobs = {pool.submit(run_clang_tidy, program, source, database): source for source in open_sources}
        for job in concurrent.futures.as_completed(jobs):
            lines, status = job.result()
            found = findings(lines)
            if status != 0 and not found:
                failed = True
                print(f"tidy: {jobs[job]}: clang-tidy ended with {status}:\n" + "\n".join(lines))
            if status == 0 and not found:
                entries[jobs[job]].touch()
            for key, text in found.items():
                if key not in seen:
                    print(text, flush=True)
            seen |= found.keys()
    print(f"tidy: {why}: {len(open_sources)} of {len(sources)} sources checked in {time.monotonic() - start:.0f} s, "
          f"the rest was clean before; "
          f"{len(seen)} finding{'' if len(seen) == 1 else 's'}", file=sys.stderr)
    return 1 if seen or failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
