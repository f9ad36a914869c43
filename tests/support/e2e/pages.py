"""Pages that are tests: their files are cut out of them, and their commands are run."""

import shlex


def blocks(page):
    """(language, text, name) of every fenced block of a page that has a language; the name is what the paragraph above
    it begins with, as `NAME`, or None."""
    found, name, fence = [], None, None
    for line in page.read_text().splitlines():
        if fence is not None:
            if line == "```":
                if fence[0]:
                    found.append((fence[0], "".join(text + "\n" for text in fence[1:]), name))
                name, fence = None, None
            else:
                fence.append(line)
        elif line.startswith("```"):
            fence = [line[3:]]
        elif line.startswith("`"):
            name = line[1:line.index("`", 1)]
    return found


def files(page, languages=("json", "csv", "text")):
    """The text of every block with a name, by name."""
    return {name: text for language, text, name in blocks(page) if language in languages and name}


def commands(page):
    """The words of every line of the blocks of the language sh. A backslash at the end of a line continues it."""
    return [shlex.split(line) for language, text, _ in blocks(page) if language == "sh"
            for line in text.replace("\\\n", " ").splitlines()]
