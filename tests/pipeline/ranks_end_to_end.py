"""Training on several ranks as a user starts it, under torchrun: equal to one process, resumed by any number, ended
together.

Run by ctest as: python ranks_end_to_end.py PATH_OF_quadruped3d. Every dataset here is made by the test itself.
"""

import json
import os
import pathlib
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import time
import unittest

import numpy as np

from end_to_end import PROGRAM, draw_pictures, run, write_annotations
from roles_end_to_end import give_bodies

STEPS = 3


def tensors(path):
    """Every float32 tensor of a safetensors file, flat, by name."""
    data = path.read_bytes()
    size, = struct.unpack("<Q", data[:8])
    header = json.loads(data[8 : 8 + size])
    return {name: np.frombuffer(data, np.float32, (entry["data_offsets"][1] - entry["data_offsets"][0]) // 4,
                                8 + size + entry["data_offsets"][0]).astype(float)
            for name, entry in header.items() if name != "__metadata__"}


def without_dropout(path):
    """Ranks draw dropout from different streams, so with it they equal one process in the mean only."""
    data = path.read_bytes()
    size, = struct.unpack("<Q", data[:8])
    header = json.loads(data[8 : 8 + size])
    config = json.loads(header["__metadata__"]["prima_config"])
    config.update(dropout=0.0, drop_path=0.0)
    header["__metadata__"]["prima_config"] = json.dumps(config)
    text = json.dumps(header).encode()
    path.write_bytes(struct.pack("<Q", len(text)) + text + data[8 + size :])


class Ranks(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.root = pathlib.Path(tempfile.mkdtemp(prefix="q3d_ranks_"))
        run("init", "--size", "tiny", "--out", cls.root / "initial.safetensors", "--smal-asset",
            cls.root / "smal.safetensors", "--priors", cls.root / "priors.safetensors")
        shutil.copy(cls.root / "initial.safetensors", cls.root / "with_dropout.safetensors")
        without_dropout(cls.root / "initial.safetensors")
        write_annotations(cls.root / "data", give_bodies(draw_pictures(cls.root / "data", 12)))
        for role in ("truth", "2d_only"):  # a batch holds samples with and without bodies
            config = {"name": "packed", "shards": {"unit_size": 6},
                      "datasets": [{"name": role, "format": "prima", "root": "data", "annotations": "train.json",
                                    "role": role}]}
            (cls.root / f"{role}.json").write_text(json.dumps(config))
            run("build", "--config", cls.root / f"{role}.json", "--out", cls.root / role)
        cls.config = cls.write_config("train")

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.root)

    @classmethod
    def write_config(cls, name, initial="initial.safetensors", **changes):
        config = {"network": {"initial": initial, "smal_asset": "smal.safetensors",
                              "priors": "priors.safetensors", "device": "cpu", "compute_threads": 1},
                  "pools": {role: {"shards": [f"{role}/latest"]} for role in ("truth", "2d_only")},
                  "stages": {"1": [{"name": "joint", "pools": ["truth", "2d_only"], "steps": STEPS,
                                    "learning_rate": 1e-3, "adversarial": True}]},
                  "batch": 4, "log_every": 1, "checkpoint_every": 1000, **changes}
        path = cls.root / f"{name}.json"
        path.write_text(json.dumps(config))
        return path

    def command(self, out, *more, config=None):
        return [PROGRAM, "train", "--config", str(config or self.config), "--stage", "1", "--out", str(self.root / out),
                "--json", *map(str, more)]

    def launcher(self, ranks=2):
        return [sys.executable, "-m", "torch.distributed.run", "--no-python", "--standalone", "--nproc-per-node",
                str(ranks)]

    def environment(self):
        # A host's own name need not resolve where tests run.
        return {**os.environ, "GLOO_SOCKET_IFNAME": "lo"}

    def torchrun(self, *arguments, expect=0, **options):
        result = subprocess.run([*self.launcher(), *self.command(*arguments, **options)], capture_output=True,
                                text=True, timeout=300, env=self.environment())
        self.assertEqual(result.returncode == 0, expect == 0, result.stderr)
        return result

    def test_two_ranks_train_as_one_process_and_one_goes_on_where_two_stopped(self):
        run(*self.command("one")[1:])
        first = json.loads(self.torchrun("two", "--max-steps", 2).stdout)  # one summary, not two
        self.assertEqual((first["steps_done"], first["finished"]), (2, False))
        run(*self.command("two")[1:])
        lines = [[json.loads(line) for line in (self.root / out / "log.jsonl").read_text().splitlines()]
                 for out in ("one", "two")]
        self.assertEqual([line["step"] for line in lines[1]], list(range(1, STEPS + 1)))
        for name, value in lines[0][0]["terms"].items():
            np.testing.assert_allclose(lines[1][0]["terms"][name], value, rtol=1e-4, atol=1e-7, err_msg=name)
        np.testing.assert_allclose(lines[1][0]["gradient_norm"], lines[0][0]["gradient_norm"], rtol=1e-4)
        # AdamW moves an element whose gradient is mere rounding by a whole step, hence the norm of all.
        start, one, two = (tensors(self.root / name) for name in ("initial.safetensors", "one/model.safetensors",
                                                                  "two/model.safetensors"))
        moved = sum(np.sum((one[name] - start[name]) ** 2) for name in one) ** 0.5
        apart = sum(np.sum((one[name] - two[name]) ** 2) for name in one) ** 0.5
        self.assertGreater(moved, 0.1)
        self.assertLess(apart / moved, 0.02)

    def test_stopped_and_resumed_the_weights_are_the_same_to_the_bit(self):
        config = self.write_config("dropout", initial="with_dropout.safetensors")
        self.torchrun("straight", config=config)
        self.torchrun("stopped", "--max-steps", 1, config=config)
        self.torchrun("stopped", config=config)
        for name in ("model.safetensors", "state.safetensors"):
            self.assertEqual((self.root / "straight" / name).read_bytes(), (self.root / "stopped" / name).read_bytes())

    def test_ranks_of_different_configurations_are_refused(self):
        for rank in range(2):
            self.write_config(f"rank{rank}", seed=rank)
        words = self.command("mixed", config=self.root / "rank$RANK.json")
        result = subprocess.run([*self.launcher(), "bash", "-c", "exec " + " ".join(words)], capture_output=True,
                                text=True, timeout=300, env=self.environment())
        self.assertNotEqual(result.returncode, 0)
        self.assertIn("rank 1 was started with another configuration", result.stderr)
        self.assertFalse((self.root / "mixed/state.safetensors").exists())

    def test_a_batch_that_cannot_be_shared_is_refused(self):
        result = self.torchrun("odd", config=self.write_config("odd", batch=3), expect=1)
        self.assertIn("a batch of 3 samples cannot be shared equally by 2 ranks", result.stderr)

    def test_signals_end_all_ranks_after_the_state_is_saved(self):
        """To one rank alone; and to the launcher, as Ctrl-C does, which passes it on to every rank."""
        steps = [{"name": "long", "pools": ["truth"], "steps": 100000}]
        config = self.write_config("long", stages={"1": steps})
        self.assertGreaterEqual(self.steps_before_signal("long", config, lambda launcher: self.rank(launcher, 1)), 2)
        saved = (self.root / "long/state.safetensors").read_bytes()
        self.assertGreaterEqual(self.steps_before_signal("long", config, lambda launcher: launcher), 4)
        self.assertNotEqual(saved, (self.root / "long/state.safetensors").read_bytes())

    def steps_before_signal(self, out, config, target):
        """Runs until the log has two more lines, interrupts the process that target(launcher's id) names, and returns
        how many steps the log then holds."""
        log = self.root / out / "log.jsonl"
        lines = lambda: log.read_text().count("\n") if log.exists() else 0
        wanted = lines() + 2
        process = subprocess.Popen([*self.launcher(), *self.command(out, config=config)], text=True,
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=self.environment())
        deadline = time.monotonic() + 240
        while lines() < wanted:
            self.assertLess(time.monotonic(), deadline)
            self.assertIsNone(process.poll())
            time.sleep(0.2)
        os.kill(target(process.pid), signal.SIGINT)
        _, errors = process.communicate(timeout=120)
        self.assertNotEqual(process.returncode, 0)
        self.assertIn("run the same command to continue", errors)
        self.assertTrue((self.root / out / "state.safetensors").exists(), errors)
        return lines()

    @staticmethod
    def rank(launcher, number):
        """The process id of a rank."""
        children = pathlib.Path(f"/proc/{launcher}/task/{launcher}/children").read_text().split()
        return next(int(child) for child in children if
                    pathlib.Path(f"/proc/{child}/cmdline").read_bytes().startswith(PROGRAM.encode()) and
                    f"\0RANK={number}\0".encode() in pathlib.Path(f"/proc/{child}/environ").read_bytes())


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1], verbosity=2)
