"""Standard streams that are closed, full or a terminal; file systems without locks and syncs; files that are no files."""

import errno
import json
import os
import pty
import shutil
import signal
import subprocess

from e2e import (DrawnCase, Fault, command, draw_pictures, environment, give_bodies, latest, make_network,
                 prima_dataset, run, verdicts, write_annotations, write_json)


class Drawn(DrawnCase):
    def build(self, *more, config=None, **options):
        return run("build", "--config", config or self.shared / "config.json", "--out", self.folder / "out", *more,
                   **options)


class Streams(Drawn):
    def ended(self, *words, closed=(), **streams):
        """The exit code and stderr of the program with these standard streams; `closed` are numbers of streams."""
        given = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **streams}
        process = subprocess.run(["sh", "-c", 'exec "$@" ' + " ".join(f"{number}>&-" for number in closed), "sh",
                                  *command(words)], env=environment(), timeout=300, **given)
        return process.returncode, (process.stderr or b"").decode()

    def test_output_that_cannot_be_written_is_a_failure(self):
        for words in (["verify", self.shared / "out", "--json"], ["inspect", self.shared / "out"],
                      ["config", "schema"], ["--help"],
                      ["build", "--config", self.shared / "config.json", "--out", self.folder / "out", "--json"]):
            with self.subTest(words=words), open("/dev/full", "wb") as full:
                code, said = self.ended(*words, stdout=full)
                self.assertEqual(code, 1, said)
                self.assertIn("stdout could not be written", said)
                self.assertIn(os.strerror(errno.ENOSPC), said)

    def test_messages_that_cannot_be_written_are_lost_and_nothing_else(self):
        with open("/dev/full", "wb") as full:
            self.assertEqual(self.ended("verify", self.shared / "out", stderr=full)[0], 0)
            self.assertEqual(self.ended("build", "--config", self.shared / "config.json", "--out", self.folder / "out",
                                        stderr=full)[0], 0)
            self.assertEqual(self.ended("verify", self.folder / "none", stderr=full)[0], 2)

    def test_closed_streams_are_survived(self):
        for closed in ([0], [1], [2], [0, 1, 2]):
            out = self.folder / f"out{''.join(map(str, closed))}"
            words = ["build", "--config", self.shared / "config.json", "--out", out]
            with self.subTest(closed=closed):
                self.assertEqual(self.ended(*words, closed=closed)[0], 0)
                run("verify", out)
                self.assertRegex((out / ".lock").read_text(), r"\Aprocess \d+ on host \S+, started \S+\Z")
        code, said = self.ended("verify", self.shared / "out", "--json", closed=[1])
        self.assertEqual(code, 1)
        self.assertIn("stdout could not be written", said)

    def test_a_reader_that_leaves_early_makes_no_noise(self):
        line = " ".join(f"'{word}'" for word in command(["config", "schema"])) + " | head -c 1"
        result = subprocess.run(["sh", "-c", line], capture_output=True, timeout=300)
        self.assertEqual((result.stdout, result.stderr), (b"{", b""))

    def test_names_do_not_reach_the_terminal_raw(self):
        """An id may hold any character that JSON can hold."""
        name = "drawn\u009b31m"  # another spelling of ESC [; the split of an id cannot hold ESC itself
        config = write_json(self.folder / "config.json",
                            {"name": "drawn", "datasets": [{**prima_dataset(self.shared / "data", role="2d_only"),
                                                            "split": name}]})
        result = self.build("--set", "tta.stop=1", config=config, expect=2)
        self.assertNotIn("\x1b", result.stderr)
        self.build(config=config)
        stories = run("explain", self.folder / "out", "p001").stdout
        self.assertIn("\u009b", stories, "a file keeps the id as it is")
        shown = self.on_a_terminal("explain", self.folder / "out", "p001")
        self.assertNotIn("\u009b", shown)
        self.assertIn("\\x9b31m", shown)

    def on_a_terminal(self, *words):
        """What the program writes to a terminal at stdout."""
        main, terminal = pty.openpty()
        with subprocess.Popen(command(words), stdout=terminal, stderr=subprocess.DEVNULL, env=environment()) as process:
            os.close(terminal)
            shown = b""
            while True:
                try:
                    part = os.read(main, 65536)
                except OSError:  # the last one who wrote has left
                    break
                if not part:
                    break
                shown += part
            self.assertEqual(process.wait(), 0)
        os.close(main)
        return shown.decode()


class Disks(Drawn):
    def test_a_disk_that_cannot_sync(self):
        result = self.build(expect=1, fault=Fault(".h5.", "sync", error=str(errno.EINVAL)))
        self.assertIn("--no-sync", result.stderr)
        self.assertFalse((self.folder / "out/latest").exists())
        self.build("--no-sync", fault=Fault(".h5.", "sync", error=str(errno.EINVAL)))
        run("verify", self.folder / "out")

    def training_words(self):
        """Arguments of a training of one step on drawn pictures with bodies."""
        data = self.folder / "bodies"
        write_annotations(data, give_bodies(draw_pictures(data, 2)))
        build = write_json(self.folder / "build.json", {"name": "bodies", "datasets": [prima_dataset(data, role="truth")]})
        run("build", "--config", build, "--out", self.folder / "labels")
        network = {"initial": "initial.safetensors", "smal_asset": "smal.safetensors", "priors": "priors.safetensors"}
        paths = {key: str(self.folder / file) for key, file in network.items()}
        make_network(paths["initial"], body=paths["smal_asset"], priors=paths["priors"])
        config = write_json(self.folder / "training.json", {
            "network": {**paths, "device": "cpu", "compute_threads": 1},
            "pools": {"bodies": {"shards": [str(self.folder / "labels/latest")]}},
            "stages": {"1": [{"name": "only", "pools": ["bodies"], "steps": 1, "learning_rate": 1e-3}]}, "batch": 2})
        return ["train", "--config", config, "--stage", "1", "--out", self.folder / "trained"]

    def test_a_disk_that_cannot_sync_takes_weights(self):
        words = self.training_words()
        fault = Fault("trained", "sync", error=str(errno.EINVAL))
        self.assertIn("--no-sync", run(*words, fault=fault, expect=1).stderr)
        run(*words, "--no-sync", fault=fault)
        self.assertTrue((self.folder / "trained/model.safetensors").exists())

    def test_a_disk_without_locks(self):
        fault = Fault(".lock", "lock", error=str(errno.ENOLCK))
        result = self.build(expect=1, fault=fault)
        self.assertIn("--no-lock", result.stderr)
        self.build("--no-lock", fault=fault)
        run("verify", self.folder / "out")

    def test_success_is_said_after_all_names_are_durable(self):
        """The last sync of a folder comes after its last name was made. A power cut loses what comes later."""
        dataset = latest(self.shared / "out").name
        for folder, name in ((f"{dataset}/shards", "000000.h5"), (dataset, "dataset.json"), ("", "latest")):
            with self.subTest(folder=folder):
                place = str(self.folder / "out" / folder).rstrip("/") + "$"
                counted = self.build(fault=Fault(place, "sync", action="count"))
                syncs = int(counted.stderr.split("faults: counted ")[-1].split()[0])
                shutil.rmtree(self.folder / "out")
                self.build(expect=-signal.SIGKILL, fault=Fault(place, "sync", action="kill", skip=syncs - 1))
                self.assertTrue((self.folder / "out" / folder / name).exists())
                shutil.rmtree(self.folder / "out")

    def test_a_link_in_the_place_of_the_lock(self):
        (self.folder / "out").mkdir()
        victim = self.folder / "victim.txt"
        victim.write_text("precious")
        (self.folder / "out/.lock").symlink_to(victim)
        self.assertIn("symbolic link", self.build(expect=1).stderr)
        self.assertEqual(victim.read_text(), "precious")


class NoFiles(Drawn):
    """A named pipe without a writer would keep whoever opens it waiting for ever."""

    def pipe(self, path):
        path.unlink(missing_ok=True)
        os.mkfifo(path)
        return path

    def test_a_picture(self):
        data = self.copy_of("data")
        self.pipe(data / "images/p001.png")
        config = write_json(self.folder / "config.json",
                            {"name": "drawn", "datasets": [prima_dataset(data, role="2d_only")]})
        self.build(config=config)
        rows = verdicts(latest(self.folder / "out"))
        self.assertEqual([row["verdict"] for row in rows], ["retained", "failed", "retained"])

    def test_annotations_and_configs(self):
        data = self.copy_of("data")
        self.pipe(data / "train.json")
        config = write_json(self.folder / "config.json",
                            {"name": "drawn", "datasets": [prima_dataset(data, role="2d_only")]})
        self.build(config=config, expect=1)
        self.build(config=self.pipe(self.folder / "pipe.json"), expect=2)

    def test_what_an_earlier_run_left(self):
        dataset = self.copy_of("out")
        for stamps in (dataset / "stages/builds").glob("*.stamps"):
            stamps.unlink()  # otherwise the build has nothing to do and reads nothing
        (dataset / "digests.txt").unlink(missing_ok=True)
        self.pipe(dataset / "digests.txt")
        run("build", "--config", self.shared / "config.json", "--out", dataset, expect=1)
        (dataset / "digests.txt").unlink()
        self.pipe(latest(dataset) / "dataset.json")
        run("verify", dataset, expect=1)

    def test_no_absolute_path_in_a_dataset(self):
        """Pictures that cannot be used are described, and two folders give one dataset."""
        datasets = []
        for name in ("one", "two"):
            data = self.copy_of("data").rename(self.folder / name)
            records = json.loads((data / "train.json").read_text())["data"]
            (data / "images/p000.png").write_bytes(b"GIF89a no")
            picture = (data / "images/p001.png").read_bytes()
            (data / "images/p001.png").write_bytes(picture[: len(picture) // 2])
            (data / "images/mask.png").write_bytes(b"no picture")
            records[2]["mask_path"] = "images/mask.png"
            write_annotations(data, records)
            config = write_json(self.folder / f"{name}.json",
                                {"name": "drawn", "datasets": [{**prima_dataset(data, role="2d_only"), "root": name}]})
            run("build", "--config", config, "--out", self.folder / f"out_{name}")
            datasets.append(latest(self.folder / f"out_{name}"))
        files = ("verdicts.csv", "dataset.json", "shards/000000.h5")
        for file in files:
            content = [(dataset / file).read_bytes() for dataset in datasets]
            self.assertNotIn(str(self.folder).encode(), content[0], file)
        self.assertEqual((datasets[0] / "verdicts.csv").read_bytes(), (datasets[1] / "verdicts.csv").read_bytes())
        details = " ".join(row["detail"] for row in verdicts(datasets[0]))
        for words in ("p000.png: got a GIF picture", "p001.png: "):
            self.assertIn(words, details)

    def test_no_absolute_path_in_what_is_passed_on(self):
        """In no file of a version, a report, an export or a part of a dataset. The config, which dataset.json repeats as
        it was written, has none either."""
        out = self.folder / "out"
        self.copy_of("data")
        config = write_json(self.folder / "config.json", {"name": "drawn", "datasets": [
            {**prima_dataset(self.shared / "data", role="2d_only"), "root": "data"}]})
        self.build("--quiet", config=config)
        run("report", out, "--gallery", 2)
        run("subset", out, "--where", "verdict = retained", "--out", self.folder / "part")
        for kind in ("coco", "prima"):
            run("export", out, "--format", kind, "--out", self.folder / kind, "--pictures-anyway")
        folders = [latest(out), out / "report", latest(self.folder / "part"), self.folder / "coco", self.folder / "prima"]
        files = [path for folder in folders for path in folder.rglob("*") if path.is_file()]
        self.assertGreater(len(files), 15)
        own = {str(self.folder), str(self.shared), os.path.expanduser("~") + "/"}
        for path in files:
            content = path.read_bytes()
            for place in own:
                self.assertNotIn(place.encode(), content, path)
