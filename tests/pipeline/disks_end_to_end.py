"""Disks that are full, read-only, without links or with short names: a build stops with a message and goes on later."""

import errno
import os
import shutil
import subprocess

from e2e import (Case, Fault, command, digests, draw_pictures, environment, fault_lines, give_bodies, latest,
                 prima_dataset, run, write_annotations, write_json)

# Which errors of which calls a file system may answer below the output folder, and what the message says to do.
REFUSALS = [("write", "ENOSPC", "free some disk space"), ("write", "EDQUOT", "free some disk space"),
            ("open", "EROFS", ""), ("open", "EACCES", "give this user permission"),
            ("open", "EMFILE", "ulimit -n"), ("mkdir", "EROFS", ""), ("mkdir", "EDQUOT", ""),
            ("rename", "EACCES", "give this user permission"), ("sync", "EINVAL", "--no-sync"),
            ("sync", "ENOTSUP", "--no-sync"), ("sync", "EIO", "check the disk"), ("lock", "ENOLCK", "--no-lock"),
            ("lock", "ENOTSUP", "--no-lock"), ("close", "EDQUOT", "free some disk space")]


class Disks(Case):
    @classmethod
    def prepare(cls):
        write_annotations(cls.shared / "data", give_bodies(draw_pictures(cls.shared / "data", 9)))
        write_json(cls.shared / "config.json",
                   {"name": "drawn", "shards": {"unit_size": 3},
                    "datasets": [prima_dataset(cls.shared / "data", role="truth")]})
        run("build", "--config", cls.shared / "config.json", "--out", cls.shared / "out")

    @classmethod
    def recall(cls):
        cls.expected = digests(latest(cls.shared / "out"))

    def words(self, out, *more, config=None):
        return ["build", "--config", config or self.shared / "config.json", "--out", self.folder / out, *more]

    def expect_same(self, out):
        self.assertEqual(digests(latest(self.folder / out)), self.expected)
        run("verify", self.folder / out)
        self.assertEqual([str(path) for path in (self.folder / out).rglob("*.tmp")], [])

    def test_what_a_disk_refuses_is_said_and_the_build_goes_on_later(self):
        for call, error, advice in REFUSALS:
            with self.subTest(call=call, error=error):
                out = f"{call}_{error}"
                result = run(*self.words(out), expect=1, fault=Fault(f"/{out}", call, error=error, skip=2 * (call == "write")))
                self.assertTrue(fault_lines(result.stderr))
                told = [line for line in result.stderr.splitlines() if line.startswith("quadruped3d: ")]
                self.assertEqual(len(told), 1, result.stderr)
                self.assertIn(os.strerror(getattr(errno, error)), told[0])
                self.assertIn(str(self.folder / out), told[0])
                self.assertIn(advice, told[0])
                self.assertFalse((self.folder / out / "latest").exists())
                run(*self.words(out))
                self.expect_same(out)

    def test_a_disk_without_hard_links_gets_copies(self):
        """exFAT and some network disks have none (EPERM), a file has too many (EMLINK), a folder lies elsewhere (EXDEV)."""
        for error in ("EPERM", "EMLINK", "EXDEV", "ENOTSUP"):
            with self.subTest(error=error):
                result = run(*self.words(error), fault=Fault("shards/", "link", error=error))
                self.assertTrue(fault_lines(result.stderr))
                self.expect_same(error)
                for shard in latest(self.folder / error).glob("shards/*"):
                    self.assertEqual(shard.stat().st_nlink, 1)

    def test_a_disk_that_is_full(self):
        """A real one, of 60 kB, that becomes larger."""
        disk = self.folder / "disk"
        disk.mkdir()
        script = ('mount -t tmpfs -o size=60k tmpfs "$1" || exit 99; disk=$1; shift; '
                  '"$@"; echo "first: $?"; ls -A "$disk"/*/latest 2>/dev/null; mount -o remount,size=50m "$disk"; '
                  '"$@" && cp -a "$disk/out" "$disk.saved"; echo "second: $?"')
        words = ["unshare", "--map-root-user", "--mount", "sh", "-c", script, "sh", disk, *command(self.words("disk/out"))]
        result = subprocess.run(list(map(str, words)), capture_output=True, text=True, env=environment(), timeout=900)
        if result.returncode == 99 or "unshare" in result.stderr:
            self.skipTest(f"this machine lets nobody mount a disk: {result.stderr.strip()}")
        self.assertEqual(result.stdout.split("\n")[:-1], ["first: 1", "second: 0"], result.stderr)
        self.assertIn(os.strerror(errno.ENOSPC), result.stderr)
        shutil.move(self.folder / "disk.saved", self.folder / "saved")
        self.expect_same("saved")

    def test_names_that_are_too_long(self):
        config = write_json(self.folder / "long.json", {
            "name": "n" * 200, "datasets": [prima_dataset(self.shared / "data", "d" * 200, role="truth")]})
        run(*self.words("long", config=config))
        run("verify", self.folder / "long")
        self.assertIn("up to 200", run(*self.words("x", "--set", "name=" + "n" * 201), expect=2).stderr)
        deep = "/".join(["f" * 200] * 25)
        said = run(*self.words(deep), expect=1).stderr
        self.assertIn(os.strerror(errno.ENAMETOOLONG), said)

    def test_a_lock_that_a_dead_host_left(self):
        """The lock is the kernel's: the file alone locks nothing, and its text says who held it last."""
        (self.folder / "out").mkdir()
        (self.folder / "out/.lock").write_text("process 4711 on host gone, started 2020-01-01T00:00:00Z")
        run(*self.words("out"))
        self.expect_same("out")
