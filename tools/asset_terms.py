"""Shows the terms of the official files and obtains the user's consent.

The terms below are summaries of what the owners publish; their own texts decide. Consent is recorded for each text, so
that a later run asks only about terms that are new or have changed here.
"""

from __future__ import annotations

import datetime
import hashlib
import os
import sys
import textwrap
from dataclasses import dataclass
from typing import Callable, Sequence

RECORD_NAME = "accepted-terms.txt"

Say = Callable[[str], None]


class ConsentRefused(ValueError):
    """The user read the terms and did not accept them."""


class ConsentMissing(Exception):
    """Nobody can be asked: there is no terminal, and the consent was not given on the command line."""


@dataclass(frozen=True)
class Terms:
    files: str
    owner: str
    conditions: str
    text: str  # where the owner's own text is

    def __str__(self) -> str:
        lines = {"owner:": self.owner, "conditions:": self.conditions, "full text:": self.text}
        wrapped = (
            textwrap.fill(text, 100, initial_indent=f"  {label:12} ", subsequent_indent=" " * 15)
            for label, text in lines.items()
        )
        return "\n".join([self.files, *wrapped])

    @property
    def digest(self) -> str:
        return hashlib.sha256(str(self).encode()).hexdigest()


PRIMA = Terms(
    "PRIMA's network weights (s1ckpt*.ckpt, s3ckpt*.ckpt)",
    "Mackenzie Mathis, Xiaohang Yu and contributors",
    "academic, non-commercial use only; no deliberate harm to any animal; copies keep the copyright and permission "
    "notice; EPFL's technology transfer office (tto@epfl.ch) answers requests for commercial use",
    "license.md (\"Modified MIT\") at https://github.com/AdaptiveMotorControlLab/PRIMA",
)
SMAL = Terms(
    "The SMAL body model, its shape families and its pose prior (my_smpl_*.pkl, walking_toy_*.pkl)",
    "Max Planck Institute for Intelligent Systems",
    "non-commercial scientific research only; no redistribution; the model's home, https://smal.is.tue.mpg.de, asks "
    "its users to register",
    "https://smal.is.tue.mpg.de/license.html",
)
BIOCLIP = Terms(
    "BioCLIP (open_clip_config.json, open_clip_pytorch_model.bin)",
    "the authors of BioCLIP (imageomics)",
    "MIT licence",
    "https://huggingface.co/imageomics/bioclip",
)
ANIMER = Terms(
    "AniMer's image encoder (amr_vitbb.pth)",
    "the authors of AniMer",
    "AniMer's code has the MIT licence; this project knows of no terms that name the weights",
    "https://github.com/luoxue-star/AniMer",
)

INTRODUCTION = "The files that `make assets` fetches belong to others and have terms of their own. In short:"
CONCLUSION = """What is made from these files (converted weights, meshes, datasets of SMAL parameters) inherits their
conditions. These are summaries. Read the full texts; they are what you agree to."""


def obtain_consent(folder: str, terms: Sequence[Terms], given: bool, say: Say) -> None:
    """Shows the terms that the user has not accepted yet, asks for consent and records it in `folder`.

    given: the user consents on the command line; the terms are shown, but nothing is asked. Throws ConsentRefused when
    the user says no, ConsentMissing when there is no terminal to ask at, and OSError.
    """
    record = os.path.join(folder, RECORD_NAME)
    accepted = _accepted_digests(record)
    new = [item for item in terms if item.digest not in accepted]
    if not new:
        return
    say("\n\n".join([INTRODUCTION, *map(str, new), CONCLUSION]))
    if given:
        say("You accepted these terms with --accept-licences.\n")
    elif not sys.stdin.isatty():
        raise ConsentMissing(
            "nothing was fetched or imported: the terms above need your consent, and there is no terminal to ask at. "
            "If you accept them, run `make assets ACCEPT_LICENCES=1` or `import_assets.py fetch --accept-licences`"
        )
    elif not _answers_yes("\nHave you read these terms, and do you accept them? [yes/no] "):
        raise ConsentRefused("nothing was fetched or imported, because you did not accept the terms")
    os.makedirs(folder, exist_ok=True)
    today = datetime.date.today().isoformat()
    with open(record, "a", encoding="utf-8") as file:
        for item in new:
            file.write(f"{item.digest}  {today}  {item.files}\n")
    say(f"Your consent is recorded in {record}.\n")


def _answers_yes(question: str) -> bool:
    try:
        return input(question).strip().lower() in ("y", "yes")
    except EOFError:
        return False


def _accepted_digests(record: str) -> set[str]:
    if not os.path.exists(record):
        return set()
    with open(record, encoding="utf-8") as file:
        return {line.split()[0] for line in file if line.strip()}
