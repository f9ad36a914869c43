"""Training on several ranks as a user starts it, under torchrun: equal to one process, resumed by any number, ended
together."""

import json
import os
import shutil
import signal
import subprocess
import sys

import numpy as np

from e2e import (LIMIT_S, Case, draw_pictures, give_bodies, make_network, prima_dataset, program, ranks_of,
                 read_safetensors, run, split_safetensors, started, wait_until, write_annotations, write_json,
                 write_safetensors)

STEPS = 3


def flat_tensors(path):
    """Every tensor of a safetensors file as float64, flat, by name."""
    return {name: tensor.astype(float).reshape(-1) for name, tensor in read_safetensors(path).items()}


def without_dropout(path):
    """Ranks draw dropout from different streams, so with it they equal one process in the mean only."""
    header, data = split_safetensors(path)
    config = json.loads(header["__metadata__"]["prima_config"])
    config.update(dropout=0.0, drop_path=0.0)
    header["__metadata__"]["prima_config"] = json.dumps(config)
    write_safetensors(path, header, data)


class Ranks(Case):
    @classmethod
    def prepare(cls):
        initial = cls.shared / "initial.safetensors"
        make_network(initial, body=cls.shared / "smal.safetensors", priors=cls.shared / "priors.safetensors")
        shutil.copy(initial, cls.shared / "with_dropout.safetensors")
        without_dropout(initial)
        data = cls.shared / "data"
        write_annotations(data, give_bodies(draw_pictures(data, 12)))
        for role in ("truth", "2d_only"):  # a batch holds samples with and without bodies
            config = write_json(cls.shared / f"{role}.json", {"name": "packed", "shards": {"unit_size": 6},
                                                              "datasets": [prima_dataset(data, role, role=role)]})
            run("build", "--config", config, "--out", cls.shared / role)

    def setUp(self):
        super().setUp()
        self.config = self.write_config("train")

    def write_config(self, name, initial="initial.safetensors", **changes):
        network = {"initial": initial, "smal_asset": "smal.safetensors", "priors": "priors.safetensors"}
        return write_json(self.folder / f"{name}.json", {
            "network": {**{key: str(self.shared / file) for key, file in network.items()}, "device": "cpu",
                        "compute_threads": 1},
            "pools": {role: {"shards": [str(self.shared / role / "latest")]} for role in ("truth", "2d_only")},
            "stages": {"1": [{"name": "joint", "pools": ["truth", "2d_only"], "steps": STEPS, "learning_rate": 1e-3,
                              "adversarial": True}]},
            "batch": 4, "log_every": 1, "checkpoint_every": 1000, **changes})

    def train(self, out, *more, config=None):
        """Arguments of a training run into folder/out."""
        return ["train", "--config", str(config or self.config), "--stage", "1", "--out", str(self.folder / out),
                "--json", *map(str, more)]

    def launcher(self, ranks=2):
        return [sys.executable, "-m", "torch.distributed.run", "--no-python", "--standalone", "--nproc-per-node",
                str(ranks)]

    def environment(self):
        # A host's own name need not resolve where tests run.
        return {**os.environ, "GLOO_SOCKET_IFNAME": "lo"}

    def launch(self, words):
        return subprocess.run([*self.launcher(), *words], capture_output=True, text=True, timeout=LIMIT_S,
                              env=self.environment())

    def torchrun(self, *arguments, expect=0, **options):
        result = self.launch([program(), *self.train(*arguments, **options)])
        self.assertEqual(result.returncode == 0, expect == 0, result.stderr)
        return result

    def logged(self, out):
        return [json.loads(line) for line in (self.folder / out / "log.jsonl").read_text().splitlines()]

    def assert_trained_alike(self, one, other):
        """The first steps agree up to rounding, and so do the weights in the end."""
        first, second = self.logged(one)[0], self.logged(other)[0]
        for name, value in first["terms"].items():
            np.testing.assert_allclose(second["terms"][name], value, rtol=1e-4, atol=1e-7, err_msg=name)
        np.testing.assert_allclose(second["gradient_norm"], first["gradient_norm"], rtol=1e-4)
        # AdamW moves an element whose gradient is mere rounding by a whole step, hence the norm of all.
        start = flat_tensors(self.shared / "initial.safetensors")
        ends = [flat_tensors(self.folder / out / "model.safetensors") for out in (one, other)]
        moved = sum(np.sum((ends[0][name] - start[name]) ** 2) for name in start) ** 0.5
        apart = sum(np.sum((ends[0][name] - ends[1][name]) ** 2) for name in start) ** 0.5
        self.assertGreater(moved, 0.1)
        self.assertLess(apart / moved, 0.02)

    def test_two_ranks_train_as_one_process_and_one_goes_on_where_two_stopped(self):
        run(*self.train("one"))
        first = json.loads(self.torchrun("two", "--max-steps", 2).stdout)  # one summary, not two
        self.assertEqual((first["steps_done"], first["finished"]), (2, False))
        run(*self.train("two"))
        self.assertEqual([line["step"] for line in self.logged("two")], list(range(1, STEPS + 1)))
        self.assert_trained_alike("one", "two")

    def test_a_batch_in_parts_on_two_ranks_trains_as_the_whole_one_on_one(self):
        run(*self.train("whole"))
        run(*self.train("parts", "--ranks", 2, "--set", "batch_parts=2"))
        self.assert_trained_alike("whole", "parts")

    def test_ranks_that_the_program_starts_itself_train_as_those_of_torchrun(self):
        config = self.write_config("dropout", initial="with_dropout.safetensors")
        self.torchrun("torchrun", config=config)
        result = run(*self.train("own", "--ranks", 2, config=config))
        self.assertEqual(len(result.stdout.splitlines()), 1)
        self.assertEqual((self.folder / "own/model.safetensors").read_bytes(),
                         (self.folder / "torchrun/model.safetensors").read_bytes())

    def test_blocks_that_are_computed_again_change_no_bit(self):
        config = self.write_config("dropout", initial="with_dropout.safetensors")
        for ranks in (1, 2):
            run(*self.train(f"plain{ranks}", "--ranks", ranks, config=config))
            run(*self.train(f"again{ranks}", "--ranks", ranks, "--set", "network.recompute=true", config=config))
            self.assertEqual((self.folder / f"plain{ranks}/model.safetensors").read_bytes(),
                             (self.folder / f"again{ranks}/model.safetensors").read_bytes())

    def test_a_killed_rank_ends_the_training(self):
        config = self.write_config("long", stages={"1": [{"name": "long", "pools": ["truth"], "steps": 100000}]})
        log = self.folder / "long/log.jsonl"
        with started(*self.train("long", "--ranks", 2, config=config)) as launcher:
            wait_until(lambda: log.exists() and log.stat().st_size > 0 or launcher.process.poll() is not None, "a step")
            os.kill(ranks_of(launcher.pid)[1], signal.SIGKILL)
            self.assertEqual(launcher.wait(), 1, launcher.stderr())
            self.assertIn("rank 1 of 2 was ended by signal 9", launcher.stderr())
            self.assertIn("rank 0 of 2: working with the other ranks failed", launcher.stderr())

    def test_a_rank_that_hangs_is_ended_when_another_is_gone(self):
        config = self.write_config("long", stages={"1": [{"name": "long", "pools": ["truth"], "steps": 100000}]})
        log = self.folder / "long/log.jsonl"
        with started(*self.train("long", "--ranks", 2, config=config)) as launcher:
            wait_until(lambda: log.exists() and log.stat().st_size > 0 or launcher.process.poll() is not None, "a step")
            ranks = ranks_of(launcher.pid)
            os.kill(ranks[0], signal.SIGSTOP)
            os.kill(ranks[1], signal.SIGKILL)
            launcher.wait_for_line("the other ranks have 30 s to finish what they are at")
            self.assertEqual(launcher.wait(), 128 + signal.SIGKILL, launcher.stderr())

    def test_stopped_and_resumed_the_weights_are_the_same_to_the_bit(self):
        config = self.write_config("dropout", initial="with_dropout.safetensors")
        self.torchrun("straight", config=config)
        self.torchrun("stopped", "--max-steps", 1, config=config)
        self.torchrun("stopped", config=config)
        for name in ("model.safetensors", "state.safetensors"):
            self.assertEqual((self.folder / "straight" / name).read_bytes(),
                             (self.folder / "stopped" / name).read_bytes())

    def test_ranks_of_different_configurations_are_refused(self):
        for rank in range(2):
            self.write_config(f"rank{rank}", seed=rank)
        words = [program(), *self.train("mixed", config=self.folder / "rank$RANK.json")]
        result = self.launch(["bash", "-c", "exec " + " ".join(f'"{word}"' for word in words)])
        self.assertNotEqual(result.returncode, 0)
        self.assertIn("rank 1 was started with another configuration", result.stderr)
        self.assertFalse((self.folder / "mixed/state.safetensors").exists())

    def test_a_batch_that_cannot_be_shared_is_refused(self):
        result = self.torchrun("odd", config=self.write_config("odd", batch=3), expect=1)
        self.assertIn("a batch of 3 samples cannot be shared equally by 2 ranks", result.stderr)

    def test_signals_end_all_ranks_after_the_state_is_saved(self):
        """To one rank alone; and to the launcher, as Ctrl-C does, which passes it on to every rank."""
        steps = [{"name": "long", "pools": ["truth"], "steps": 100000}]
        config = self.write_config("long", stages={"1": steps})
        self.assertGreaterEqual(self.steps_before_signal("long", config, lambda launcher: ranks_of(launcher)[1]), 2)
        saved = (self.folder / "long/state.safetensors").read_bytes()
        self.assertGreaterEqual(self.steps_before_signal("long", config, lambda launcher: launcher), 4)
        self.assertNotEqual(saved, (self.folder / "long/state.safetensors").read_bytes())

    def steps_before_signal(self, out, config, target):
        """Runs until the log has two more lines, interrupts the process that target(launcher's id) names, and returns
        how many steps the log then holds."""
        log = self.folder / out / "log.jsonl"
        lines = lambda: log.read_text().count("\n") if log.exists() else 0
        wanted = lines() + 2
        process = subprocess.Popen([*self.launcher(), program(), *self.train(out, config=config)], text=True,
                                   stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, env=self.environment())
        self.addCleanup(self.end, process)

        def has_lines():
            self.assertIsNone(process.poll())
            return lines() >= wanted

        wait_until(has_lines, f"{wanted} lines in {log}")
        os.kill(target(process.pid), signal.SIGINT)
        _, errors = process.communicate(timeout=LIMIT_S)
        self.assertNotEqual(process.returncode, 0)
        self.assertIn("run the same command to continue", errors)
        self.assertTrue((self.folder / out / "state.safetensors").exists(), errors)
        return lines()

    @staticmethod
    def end(process):
        """Ends the launcher, which ends its ranks, where a failed assertion left them running."""
        process.terminate()
        process.wait(LIMIT_S)
        process.stderr.close()
