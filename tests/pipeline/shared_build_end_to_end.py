"""One build on several ranks, as torchrun or srun starts it: the bytes of one process, also when ranks die."""

import shutil
import signal
import subprocess
import sys

from e2e import (LIMIT_S, Fault, Rank, SmallUnitsCase, build_digests, command, environment, launcher_store, own_store,
                 prima_dataset, run, wait_until)

# Rank 0 syncs two files of the stage's folder when it opens it; then it syncs its first shard.
FIRST_SHARD_OF_RANK_0 = 2


class SharedBuild(SmallUnitsCase):
    def words(self, out, *more, config=None):
        return self.scene.build_words(out, *more, config=config or self.config)

    def start(self, words, rank, ranks, store, fault=None):
        log = self.folder / f"rank{rank}.{store['MASTER_PORT']}.log"
        started = Rank(words, rank, ranks, store, log, fault)
        self.addCleanup(started.end)
        return started

    def launcher_store(self):
        store, variables = launcher_store()
        self.addCleanup(lambda: store)  # keeps it
        return variables

    def start_all(self, words, ranks, faults=None):
        store = own_store()
        return [self.start(words, rank, ranks, store, (faults or {}).get(rank)) for rank in range(ranks)]

    def wait_all(self, ranks, expect=0):
        codes = [rank.wait() for rank in ranks]
        self.assertEqual(codes, [expect] * len(ranks), "\n".join(rank.stderr() for rank in ranks))

    def shards_of_others(self, out):
        """How many shards ranks other than 0 have made, as their own journals say."""
        return sum(path.read_text().count("\n") for path in
                   (self.folder / out).glob("stages/shards-*/journal.jsonl.*"))

    def test_two_and_three_ranks_publish_the_bytes_of_one(self):
        for ranks in (2, 3):
            started = self.start_all(self.words(f"out{ranks}", "--json"), ranks)
            self.wait_all(started)
            self.assert_equals_one(f"out{ranks}")
            self.assertEqual(started[0].summary()["candidates"], 24)
            for other in started[1:]:
                self.assertEqual(other.out.read_text(), "")
                self.assertEqual(other.stderr(), "")
            again = self.start_all(self.words(f"out{ranks}", "--json"), ranks)
            self.wait_all(again)
            self.assertTrue(again[0].summary()["up_to_date"])

    def test_the_ranks_share_the_units(self):
        store = self.launcher_store()
        stop = Fault("shards-", "sync", "stop", skip=FIRST_SHARD_OF_RANK_0)
        first = self.start(self.words("out", "--json"), 0, 2, store, stop)
        first.wait_for_fault()
        second = self.start(self.words("out", "--json"), 1, 2, store)
        wait_until(lambda: self.shards_of_others("out") >= 6 or second.process.poll() is not None, "six shards")
        first.send(signal.SIGCONT)
        self.wait_all([first, second])
        self.assert_equals_one("out")
        summary = first.summary()
        self.assertLess(summary["crops_encoded"], summary["retained"] + summary["refined"])

    def test_under_torchrun(self):
        result = subprocess.run([sys.executable, "-m", "torch.distributed.run", "--no-python", "--standalone",
                                 "--nproc-per-node", "2", *command(self.words("out", "--json"))],
                                capture_output=True, text=True, timeout=LIMIT_S, env=environment())
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(len(result.stdout.splitlines()), 1, result.stdout)
        self.assert_equals_one("out")

    def test_calibrate_shares_the_predictions(self):
        words = ["calibrate", "--config", self.config, "--out", self.folder / "pool", "--write",
                 self.folder / "two.json"]
        self.wait_all(self.start_all(words, 2))
        run("calibrate", "--config", self.config, "--out", self.folder / "alone", "--write", self.folder / "one.json")
        self.assertEqual((self.folder / "two.json").read_text(), (self.folder / "one.json").read_text())
        self.assertEqual(build_digests(self.folder / "pool"), build_digests(self.folder / "alone"))

    def test_a_build_without_a_network_is_shared_too(self):
        config = self.scene.write_config("plain.json", datasets=[prima_dataset(self.scene.data, role="2d_only")],
                                         shards={"unit_size": 3})
        run("build", "--config", config, "--out", self.folder / "alone")
        self.wait_all(self.start_all(["build", "--config", config, "--out", self.folder / "shared"], 3))
        self.assertEqual(build_digests(self.folder / "shared"), build_digests(self.folder / "alone"))

    def start_stopped(self, fault):
        """Two ranks that have stopped themselves: the first before its first shard, the second at the fault."""
        store = self.launcher_store()
        first = self.start(self.words("out"), 0, 2, store,
                           Fault("shards-", "sync", "stop", skip=FIRST_SHARD_OF_RANK_0))
        first.wait_for_fault()
        second = self.start(self.words("out"), 1, 2, store, fault)
        second.wait_for_fault()
        return first, second

    def test_a_killed_rank_loses_its_open_units_and_the_others_finish(self):
        first, second = self.start_stopped(Fault("shards-", "sync", "stop", skip=3))
        made = self.shards_of_others("out")
        self.assertGreater(made, 0)
        second.send(signal.SIGKILL)
        first.send(signal.SIGCONT)
        self.wait_all([first])
        self.assert_equals_one("out")

    def start_and_stop_second(self):
        """Two ranks. The second has made a unit and stopped itself when a file of the next had its temporary name."""
        first, second = self.start_stopped(Fault(".h5", "rename", "stop", skip=6))
        self.assertEqual(len(list((self.folder / "out").rglob("*.tmp"))), 2)  # one of each rank
        first.send(signal.SIGCONT)
        return first, second

    def test_a_rank_that_is_killed_in_a_write_leaves_no_temporary_file(self):
        first, second = self.start_and_stop_second()
        second.send(signal.SIGKILL)
        self.wait_all([first])
        self.assert_equals_one("out")

    def test_a_rank_that_wakes_when_all_is_over_does_no_harm(self):
        """It was paused for so long that rank 0 took it for dead, made its units and published."""
        first, second = self.start_and_stop_second()
        self.wait_all([first])
        self.assert_equals_one("out")
        second.send(signal.SIGCONT)
        self.wait_all([second])
        self.assert_equals_one("out")

    def test_when_rank_0_is_killed_the_others_finish_and_the_next_start_completes(self):
        store = self.launcher_store()
        first = self.start(self.words("out"), 0, 2, store,
                           Fault("shards-", "sync", "stop", skip=FIRST_SHARD_OF_RANK_0))
        first.wait_for_fault()
        second = self.start(self.words("out"), 1, 2, store)
        self.wait_all([second])
        self.assertEqual(self.shards_of_others("out"), 12)  # those that rank 0 had open too
        first.send(signal.SIGKILL)
        first.wait()
        self.assertFalse((self.folder / "out/latest").exists())
        self.scene.build("out", config=self.config)
        self.assert_equals_one("out")

    def test_when_rank_0_is_killed_with_the_store_the_next_start_completes(self):
        store = own_store()
        first = self.start(self.words("out"), 0, 2, store,
                           Fault("shards-", "sync", "hang", skip=FIRST_SHARD_OF_RANK_0))
        first.wait_for_fault()
        second = self.start(self.words("out"), 1, 2, store)
        wait_until(lambda: self.shards_of_others("out") >= 6 or second.process.poll() is not None, "six shards")
        first.send(signal.SIGKILL)
        self.assertEqual(second.wait(), 1, second.stderr())
        self.assertIn("rank 0 has ended or cannot be reached", second.stderr())
        self.assertIn("run the same command again", second.stderr())
        self.wait_all(self.start_all(self.words("out"), 2))
        self.assert_equals_one("out")

    def test_when_rank_0_fails_it_tells_why_and_the_next_start_completes(self):
        """It fails within its first shard, while another thread tells of the other rank's units."""
        store = own_store()
        fault = Fault("shards-", "sync", error="EIO", skip=FIRST_SHARD_OF_RANK_0)
        first, second = self.start(self.words("out"), 0, 2, store, fault), self.start(self.words("out"), 1, 2, store)
        self.assertEqual(first.wait(), 1, first.stderr())
        self.assertIn("check the disk", first.stderr())
        self.assertIn(second.wait(), (0, 1), second.stderr())
        self.assertFalse((self.folder / "out/latest").exists())
        self.wait_all(self.start_all(self.words("out"), 2))
        self.assert_equals_one("out")

    def test_a_rank_of_another_configuration_is_refused_and_the_others_finish(self):
        store = own_store()
        first = self.start(self.words("out"), 0, 2, store)
        other = self.start(self.words("out", "--set", "tta.learning_rate=2e-3"), 1, 2, store)
        self.assertEqual(other.wait(), 2)
        self.assertIn("rank 1 of 2: it was started with another configuration than rank 0", other.stderr())
        self.assertEqual(first.wait(), 0, first.stderr())
        self.assert_equals_one("out")

    def test_two_builds_on_one_folder_are_refused(self):
        hang = Fault("predict-", "sync", "hang", skip=3)
        first = self.start_all(self.words("out"), 1, {0: hang})
        first[0].wait_for_fault()
        second = self.start_all(self.words("out"), 2)
        self.assertEqual([rank.wait() for rank in second], [1, 1])
        self.assertIn("is in use by another build", second[0].stderr())
        self.assertIn("rank 0 ended before the work began", second[1].stderr())

    def test_ranks_on_cpus_need_a_number_of_threads(self):
        started = self.start_all(self.words("out", "--set", "network.compute_threads=0"), 2)
        self.assertEqual([rank.wait() for rank in started], [2, 2])
        self.assertIn("network.compute_threads is 0", started[0].stderr())

    def test_a_signal_ends_all_ranks_and_the_next_start_completes(self):
        hang = Fault("shards-", "sync", "hang", skip=FIRST_SHARD_OF_RANK_0)
        started = self.start_all(self.words("out"), 2, {0: hang})
        started[0].wait_for_fault()
        for rank in started:
            rank.send(signal.SIGTERM)
        for rank in started:
            self.assertNotEqual(rank.wait(), 0)
        self.wait_all(self.start_all(self.words("out"), 2))
        self.assert_equals_one("out")
