"""Implements `make assets`: downloads the official files by their published names, verifies them and imports them.

It downloads from the publishers' own pages only. Where the publisher states a digest (Hugging Face does for large
files), the file must match it. The digest of every file is also recorded at its first use, in a lock file that
`sha256sum -c` can read, and the file must match it from then on.
"""

from __future__ import annotations

import functools
import hashlib
import http.client
import os
import re
import urllib.error
import urllib.request
from dataclasses import dataclass
from typing import Callable, Optional, Sequence

import asset_terms
import prima_import
import safetensors_file
import smal_import

HUB = os.environ.get("HF_ENDPOINT", "https://huggingface.co").rstrip("/")  # the hub's own tools read HF_ENDPOINT, too
TIMEOUT_S = 30
CHUNK_BYTES = 1 << 20
LOCK_NAME = "sha256.lock"
PRIMA, BIOCLIP = "MLAdaptiveIntelligence/PRIMA", "imageomics/bioclip"

Say = Callable[[str], None]


class Unavailable(Exception):
    """A file cannot be downloaded now."""


class Offline(Unavailable):
    """The publisher cannot be reached, so it is useless to try other files."""


@dataclass(frozen=True)
class Asset:
    names: tuple[str, ...]  # the published names; the first that exists is used
    repository: str
    meaning: str


CHECKPOINTS = {
    "1": Asset(("s1ckpt_inference.ckpt", "s1ckpt.ckpt"), PRIMA, "the Stage 1 network"),
    "3": Asset(("s3ckpt_inference.ckpt", "s3ckpt.ckpt"), PRIMA, "the Stage 3 network"),
}
BODY = Asset(("my_smpl_00781_4_all.pkl",), PRIMA, "the SMAL body model")
FAMILIES = Asset(("my_smpl_data_00781_4_all.pkl",), PRIMA, "the SMAL shape families")
POSE_PRIOR = Asset(("walking_toy_symmetric_pose_prior_with_cov_35parts.pkl",), PRIMA, "the SMAL pose prior")
BIOCLIP_CONFIG = Asset(("open_clip_config.json",), BIOCLIP, "BioCLIP's settings")
BIOCLIP_WEIGHTS = Asset(("open_clip_pytorch_model.bin",), BIOCLIP, "BioCLIP, for training from scratch")
BACKBONE = Asset(("amr_vitbb.pth",), PRIMA, "AniMer's ViT, for training from scratch")


def run(folder: str, stage: str, training: bool, offline: bool, accept: bool, say: Say) -> int:
    """Shows the terms of the files and, once the user has accepted them, fetches, verifies and imports the files.

    folder: where the results go; the official files go into its folder `official`. stage: "1" or "3", the network.
    training: also fetch what training from scratch starts from. offline: download nothing. accept: the user accepts
    the terms beforehand. Returns 0 when every file is there, verified and imported, else 1. Throws what
    asset_terms.obtain_consent and the importers throw.
    """
    terms = [asset_terms.PRIMA, asset_terms.SMAL, asset_terms.BIOCLIP] + [asset_terms.ANIMER] * training
    asset_terms.obtain_consent(folder, terms, accept, say)
    store = Store(os.path.join(folder, "official"), offline, say)
    checkpoint, body, families, pose = (store.get(asset) for asset in (CHECKPOINTS[stage], BODY, FAMILIES, POSE_PRIOR))
    bioclip_config = store.get(BIOCLIP_CONFIG, optional=not training)
    if training:
        store.get(BACKBONE)
        store.get(BIOCLIP_WEIGHTS)
    import_network = functools.partial(prima_import.import_checkpoint, open_clip_config=bioclip_config)
    products = (
        ("prima.safetensors", (checkpoint,), import_network),
        ("smal.safetensors", (body,), smal_import.import_body),
        ("priors.safetensors", (families, pose), smal_import.import_priors),
    )
    for name, sources, importer in products:
        target = os.path.join(folder, name)
        if None in sources:
            continue
        if _is_made_of(target, sources):
            say(f"{target}: up to date")
        else:
            importer(*sources, target, say)
    if store.missing:
        say("\nThese files are missing. Download them in a browser:")
        for asset in store.missing:
            say(f"  {store.path(asset.names[0])}: {asset.meaning}, from {HUB}/{asset.repository}")
        say("and run `make assets` again.")
    return 1 if store.missing else 0


def _is_made_of(target: str, sources: Sequence[str]) -> bool:
    """Returns True when `target` names these files as its sources and is not older than they are."""
    if not os.path.exists(target):
        return False
    made_of = safetensors_file.read(target)[1].get(safetensors_file.SOURCE_KEY)
    newest = max(os.stat(path).st_mtime for path in sources)
    return made_of == safetensors_file.source_names(sources) and os.stat(target).st_mtime >= newest


class Store:
    """The folder of official files and the digests that they had at their first use."""

    def __init__(self, folder: str, offline: bool, say: Say):
        self.folder = folder
        self.offline = offline
        self.say = say
        self.missing: list[Asset] = []
        os.makedirs(folder, exist_ok=True)

    def path(self, name: str) -> str:
        return os.path.join(self.folder, name)

    def get(self, asset: Asset, optional: bool = False) -> Optional[str]:
        """Returns the path of the verified file, downloading it if necessary. Returns None when that is impossible, and
        then adds the file to `missing` unless it is optional."""
        for name in asset.names:
            if os.path.exists(self.path(name)):
                self._verify(name, _digest(self.path(name)))
                return self.path(name)
        if not self.offline:
            try:
                for name in asset.names:
                    if self._download(asset.repository, name):
                        return self.path(name)
                self.say(f"{asset.repository} has no file named {' or '.join(asset.names)}")
            except Unavailable as error:
                self.say(f"no download: {error}")
                self.offline = isinstance(error, Offline)
        if not optional:
            self.missing.append(asset)
        return None

    def _download(self, repository: str, name: str) -> bool:
        """Downloads and verifies a file. Returns False when the repository has no such file."""
        published = _published_digest(repository, name)
        response = _open(f"{HUB}/{repository}/resolve/main/{name}")
        if response is None:
            return False
        partial = self.path(f".{name}.part")
        try:
            digest = self._receive(response, name, partial)
            if published and digest != published:
                raise prima_import.ImportFault(
                    f"{name}: SHA-256 {digest}, but its publisher states {published}; download it again, and if they "
                    "still differ, do not use the file"
                )
            self._verify(name, digest, published)
            os.replace(partial, self.path(name))
        finally:
            if os.path.exists(partial):
                os.unlink(partial)
        return True

    def _receive(self, response, name: str, partial: str) -> str:
        digest = hashlib.sha256()
        with response, open(partial, "wb") as file:
            size = int(response.headers.get("Content-Length") or 0)
            self.say(f"fetching {name} ({size / 1e6:.1f} MB) from {response.url.split('?')[0]}")
            try:
                while chunk := response.read(CHUNK_BYTES):
                    digest.update(chunk)
                    file.write(chunk)
            except (http.client.HTTPException, TimeoutError, ConnectionError) as error:
                raise Unavailable(f"{name}: the connection broke after {file.tell()} bytes ({error})") from None
            if size and file.tell() != size:
                raise Unavailable(f"{name}: the connection ended after {file.tell()} of {size} bytes")
            file.flush()
            os.fsync(file.fileno())
        return digest.hexdigest()

    def _verify(self, name: str, digest: str, published: Optional[str] = None) -> None:
        lock = self.path(LOCK_NAME)
        known = _read_lock(lock)
        if name in known:
            if known[name] != digest:
                raise prima_import.ImportFault(
                    f"{self.path(name)}: SHA-256 {digest}, but it was {known[name]} at its first use ({lock}). If "
                    "you replaced the file on purpose, remove its line there"
                )
            self.say(f"{name}: SHA-256 as in {lock}")
            return
        with open(lock, "a", encoding="utf-8") as file:
            file.write(f"{digest}  {name}\n")
        first_use = f"recorded in {lock} at this first use, since no published digest is known"
        origin = "as published" if published else first_use
        self.say(f"{name}: SHA-256 {digest}, {origin}")


def _published_digest(repository: str, name: str) -> Optional[str]:
    """Returns the SHA-256 that the hub states for a file, or None. The hub stores large files outside the repository,
    which holds a pointer with the digest instead."""
    response = _open(f"{HUB}/{repository}/raw/main/{name}")
    if response is None:
        return None
    with response:
        pointer = response.read(1024)
    found = re.search(rb"^oid sha256:([0-9a-f]{64})$", pointer, re.MULTILINE)
    return found[1].decode() if found and pointer.startswith(b"version https://git-lfs") else None


def _open(url: str):
    """Returns the response, or None when there is no such file. Throws Unavailable."""
    request = urllib.request.Request(url, headers={"User-Agent": "quadruped3d-import-assets"})
    try:
        return urllib.request.urlopen(request, timeout=TIMEOUT_S)
    except urllib.error.HTTPError as error:
        if error.code == 404:
            return None
        raise Unavailable(f"{url} answers {error.code} {error.reason}") from None
    except (urllib.error.URLError, OSError) as error:
        raise Offline(f"{url} cannot be reached ({getattr(error, 'reason', error)})") from None


def _read_lock(path: str) -> dict[str, str]:
    if not os.path.exists(path):
        return {}
    with open(path, encoding="utf-8") as file:
        lines = [line.split() for line in file if line.strip()]
    return {fields[-1].lstrip("*"): fields[0] for fields in lines}


def _digest(path: str) -> str:
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
