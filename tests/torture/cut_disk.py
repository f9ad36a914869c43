"""A disk in a file whose power can be cut: what a cut would leave is a copy of the file, taken at that moment.

An ext4 file system lies in an image, and the image lies on an outer disk, which is an ext4 file system in an image too.
All that the kernel has written to the inner disk is in the inner image. A cut that loses what the disk has in its cache
loses more: everything since the last flush. A flush of the inner disk is a sync of the inner image on the outer disk, so
the outer image holds exactly what was flushed, and what the kernel wrote back on its own.
"""

import filecmp
import subprocess
import time

_INNER_BYTES = 96 << 20
_OUTER_BYTES = 128 << 20
# How the inner file system is mounted. ext4's default (auto_da_alloc) protects programs that rename before they sync;
# this program must not need that. commit=1 makes names reach the disk after a second, before data that nobody synced.
OPTIONS = ("defaults", "noauto_da_alloc,commit=1", "noauto_da_alloc,commit=1,data=writeback")


class NoDisks(Exception):
    """This machine lets nobody mount an image."""


def _call(*words):
    result = subprocess.run(list(map(str, words)), capture_output=True, text=True)
    if result.returncode != 0:
        raise RuntimeError(f"{' '.join(map(str, words))}: {result.stderr.strip()}")


def _copy(source, target):
    """Copies an image that the kernel may write at this moment, until two copies are the same, so that the copy is of one
    moment."""
    for _ in range(100):
        subprocess.run(["cp", "--sparse=always", source, target], check=True)
        if filecmp.cmp(source, target, shallow=False):
            return
        time.sleep(0.01)
    raise AssertionError(f"{source} never stays as it is for as long as a copy takes")


class CutDisk:
    """The inner disk is mounted at `folder`/disk. Tests write below `place`."""

    def __init__(self, folder):
        self._outer_image = folder / "outer.image"
        self._outer = folder / "outer"
        self._inner_image = self._outer / "inner.image"
        self._inner = folder / "disk"
        self._template = folder / "empty.image"
        self._mounted = []
        self.place = self._inner / "work"
        folder.mkdir(parents=True)
        for point in (self._outer, self._inner):
            point.mkdir()

    def _mount(self, image, point, options):
        _call("mount", "-o", f"loop,{options}", image, point)
        self._mounted.append(point)

    def _make_template(self):
        """Both file systems, with the inner image written once, so that later writes change no metadata outside."""
        with open(self._template, "wb") as file:
            file.truncate(_OUTER_BYTES)
        _call("mkfs.ext4", "-q", "-F", "-J", "size=4", self._template)
        self._mount(self._template, self._outer, "defaults")
        self._inner_image.write_bytes(b"\1" * _INNER_BYTES)
        _call("mkfs.ext4", "-q", "-F", "-E", "nodiscard,lazy_itable_init=0,lazy_journal_init=0", self._inner_image)
        self.unmount()

    def start_empty(self, options):
        """Mounts an empty disk."""
        self.unmount()
        _call("cp", "--sparse=always", self._template, self._outer_image)
        self._mount(self._outer_image, self._outer, "defaults")
        self._mount(self._inner_image, self._inner, options)
        self.place.mkdir()
        _call("sync", "-f", self.place)

    def cut(self, keeps_cache, target):
        """Copies what a cut at this moment would leave: all that was written to the disk, or only what was flushed."""
        _copy(self._inner_image if keeps_cache else self._outer_image, target)

    def start_from(self, image, kept_cache, options):
        """Mounts what a cut left, in the place of the disk. The file system replays its journal."""
        self.unmount()
        if kept_cache:
            self._mount(image, self._inner, options)
            return
        self._mount(image, self._outer, "defaults")
        self._mount(self._inner_image, self._inner, options)

    def unmount(self):
        """The kernel may hold the inner image for a moment after its file system is gone."""
        for _ in range(100):
            try:
                while self._mounted:
                    _call("umount", self._mounted[-1])
                    self._mounted.pop()
                return
            except RuntimeError as error:
                if "busy" not in str(error):
                    raise
                time.sleep(0.1)
        raise RuntimeError(f"{self._mounted[-1]} stays busy")

    def __enter__(self):
        try:
            self._make_template()
        except (RuntimeError, FileNotFoundError) as error:
            self.unmount()
            raise NoDisks(str(error)) from error
        return self

    def __exit__(self, *_):
        self.unmount()
