"""`--ranks N`: the program starts its own ranks. The bytes of one process, one message for a mistake, and no rank that
outlives the run."""

import contextlib
import os
import pathlib
import shutil
import signal
import subprocess

from e2e import LIMIT_S, Fault, SmallUnitsCase, command, ranks_of, run, run_json, started, wait_until

# A rank hangs when it writes its first shard, or soon after.
IN_SHARDS = Fault("shards-", "sync", "hang", skip=2)


def state_of(pid):
    """The state of a process, such as S or T; nothing if it is gone."""
    with contextlib.suppress(FileNotFoundError, ProcessLookupError):
        return pathlib.Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    return None


def is_alive(pid):
    return state_of(pid) not in (None, "Z", "X")


class LocalRanks(SmallUnitsCase):
    def words(self, *more):
        return self.scene.build_words("out", *more, config=self.config)

    @contextlib.contextmanager
    def hanging(self, ranks=2):
        """A build all of whose ranks hang: (the launcher, {rank: process id})."""
        with started(*self.words("--ranks", ranks), fault=IN_SHARDS) as launcher:
            wait_until(lambda: launcher.stderr().count("faults: ") >= ranks or launcher.process.poll() is not None,
                       "all ranks to hang")
            processes = ranks_of(launcher.pid)
            self.assertEqual(sorted(processes), list(range(ranks)), launcher.stderr())
            yield launcher, processes

    def assert_all_end(self, processes):
        wait_until(lambda: not any(map(is_alive, processes.values())), "the end of all ranks")

    def test_the_files_are_those_of_one_process(self):
        for ranks in (2, 3):
            result = run(*self.words("--json", "--ranks", ranks))
            self.assertEqual(len(result.stdout.splitlines()), 1)
            self.assert_equals_one()
            self.assertTrue(run_json(*self.words(f"--ranks={ranks}"))["up_to_date"])
            shutil.rmtree(self.folder / "out")

    def test_calibrate_has_ranks(self):
        run("calibrate", "--config", self.config, "--out", self.folder / "pool", "--ranks", 2, "--write",
            self.folder / "two.json")
        run("calibrate", "--config", self.config, "--out", self.folder / "alone", "--write", self.folder / "one.json")
        self.assertEqual((self.folder / "two.json").read_text(), (self.folder / "one.json").read_text())

    def test_a_mistake_is_told_once(self):
        wrong = run(*self.words("--ranks", 3, "--set", "tta.lerning_rate=1"), expect=2)
        self.assertEqual(wrong.stderr.count("did you mean"), 1, wrong.stderr)
        wrong = run(*self.words("--ranks", 3, "--no-such-option"), expect=2)
        self.assertEqual(wrong.stderr.count("no-such-option"), 1, wrong.stderr)
        for number in ("0", "two", "1025", "-1"):
            self.assertIn("--ranks", run(*self.words("--ranks", number), expect=2).stderr)
        self.assertIn("--ranks", run("verify", "out", "--ranks", 2, expect=2).stderr)
        self.assertFalse((self.folder / "out").exists())

    def test_two_launchers_are_refused(self):
        for variables in ({"WORLD_SIZE": "2", "RANK": "0"}, {"SLURM_STEP_ID": "0", "SLURM_NTASKS": "2"}):
            result = subprocess.run(command(self.words("--ranks", 2)), capture_output=True, text=True,
                                    env={**os.environ, **variables}, timeout=LIMIT_S)
            self.assertEqual(result.returncode, 2)
            self.assertIn("a launcher has started this process", result.stderr)

    def test_several_gpus_are_one_for_each_rank(self):
        said = run(*self.words("--set", "network.device=cuda:0,cuda:1"), expect=2).stderr
        self.assertIn("got 2 GPUs", said)
        self.assertIn("--ranks 2", said)
        said = run(*self.words("--set", "network.device=cuda:0,cuda:1", "--ranks", 3), expect=2).stderr
        self.assertIn("for 3 processes", said)
        # Two ranks were started, and rank 0 asks for its GPU.
        said = run(*self.words("--device", "cuda:0,cuda:1"), expect=None).stderr
        self.assertNotIn("got 2 GPUs", said)

    def test_a_killed_rank_is_named_and_the_others_finish(self):
        with started(*self.words("--ranks", 2)) as launcher:
            os.kill(wait_until(lambda: ranks_of(launcher.pid).get(1), "rank 1"), signal.SIGKILL)
            self.assertEqual(launcher.wait(), 0, launcher.stderr())
            self.assertIn("rank 1 of 2 was ended by signal 9 (Killed)", launcher.stderr())
        self.assert_equals_one()

    def test_the_exit_code_is_that_of_rank_0(self):
        with self.hanging() as (launcher, processes):
            os.kill(processes[0], signal.SIGKILL)
            os.kill(processes[1], signal.SIGKILL)
            self.assertEqual(launcher.wait(), 128 + signal.SIGKILL)
            self.assertIn("rank 0 of 2 was ended by signal 9 (Killed); run the same command to continue",
                          launcher.stderr())
        run(*self.words("--ranks", 2))
        self.assert_equals_one()

    def test_ranks_that_outlive_rank_0_are_ended(self):
        with self.hanging() as (launcher, processes):
            os.kill(processes[0], signal.SIGKILL)
            launcher.wait_for_line("the other ranks have 30 s to finish what they are at")
            self.assertEqual(launcher.wait(), 128 + signal.SIGKILL, launcher.stderr())
            self.assert_all_end(processes)

    def test_a_signal_reaches_every_rank_once(self):
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            with self.hanging() as (launcher, processes):
                launcher.send(number)
                self.assertEqual(launcher.wait(), 128 + number, launcher.stderr())
                self.assertEqual(launcher.stderr().count("interrupted: "), 1, launcher.stderr())
                self.assert_all_end(processes)
        run(*self.words("--ranks", 2))
        self.assert_equals_one()

    def test_a_pause_pauses_all(self):
        with self.hanging() as (launcher, processes):
            launcher.send(signal.SIGTSTP)
            self.assertTrue(launcher.wait_for_stop())
            wait_until(lambda: all(state_of(pid) == "T" for pid in processes.values()), "the pause of all ranks")
            launcher.send(signal.SIGCONT)
            wait_until(lambda: all(state_of(pid) != "T" for pid in processes.values()), "all ranks to go on")

    def test_ranks_end_with_a_killed_launcher(self):
        with self.hanging() as (launcher, processes):
            launcher.send(signal.SIGKILL)
            launcher.wait()
            self.assert_all_end(processes)
        run(*self.words("--ranks", 2))
        self.assert_equals_one()
