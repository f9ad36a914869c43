"""`evaluate` goes on after it was stopped, and ranks share it; the files are those of one undisturbed process."""

import shutil
import signal

from PIL import Image, ImageOps

from e2e import (Case, Fault, Rank, copy_folder, digests, draw_pictures, give_bodies, kill_and_resume,
                 launcher_store, make_network, own_store, prima_dataset, run, started, write_annotations, write_json)

SETS = ("one", "two", "three", "four")  # each gives a unit


class SharedEvaluation(Case):
    @classmethod
    def prepare(cls):
        write_annotations(cls.shared / "data", give_bodies(draw_pictures(cls.shared / "data", 5)))
        make_network(cls.shared / "tiny.safetensors", seed=4, body=cls.shared / "smal.safetensors")
        cls.write_config(cls.shared, cls.shared / "data")
        run(*cls.words(cls.shared / "config.json", cls.shared / "alone"))

    @classmethod
    def write_config(cls, folder, data):
        return write_json(folder / "config.json", {
            "datasets": [prima_dataset(data, name) for name in SETS], "tta": {"learning_rate": 1e-3},
            "network": {"checkpoint": str(cls.shared / "tiny.safetensors"),
                        "smal_asset": str(cls.shared / "smal.safetensors"), "device": "cpu", "compute_threads": 1}})

    @staticmethod
    def words(config, out, *more):
        return ["evaluate", "--config", config, "--out", out, "--tta", 2, "--quiet", *more]

    def setUp(self):
        super().setUp()
        self.config = self.shared / "config.json"
        self.out = self.folder / "out"

    def start_ranks(self, ranks, faults=None, store=None):
        store = store or own_store()
        all_ranks = []
        for rank in range(ranks):
            log = self.folder / f"rank{rank}.log"
            all_ranks.append(Rank(self.words(self.config, self.out), rank, ranks, store, log, (faults or {}).get(rank)))
            self.addCleanup(all_ranks[-1].end)
        return all_ranks

    def assert_as_alone(self):
        self.assertEqual(digests(self.out), digests(self.shared / "alone"))

    def stop_after(self, units, *more, config=None):
        """Kills an evaluation that has finished so many units."""
        with started(*self.words(config or self.config, self.out, *more),
                     fault=Fault("unit-", "rename", "stop", skip=units)) as running:
            self.assertTrue(running.wait_for_stop(), running.stderr())
            running.send(signal.SIGKILL)
            running.wait()
        self.assertTrue((self.out / ".parts").exists())

    def test_killed_again_and_again_it_ends_with_the_same_files(self):
        self.assertGreaterEqual(kill_and_resume(*self.words(self.config, self.out)), 2)
        self.assert_as_alone()

    def test_killed_while_it_writes_its_tables_it_ends_with_the_same_files(self):
        for file in ("samples.csv", "evaluation.json"):
            with started(*self.words(self.config, self.out), fault=Fault(file, "rename", "stop")) as running:
                self.assertTrue(running.wait_for_stop(), running.stderr())
                running.send(signal.SIGKILL)
                running.wait()
            run(*self.words(self.config, self.out))
            self.assert_as_alone()
            shutil.rmtree(self.out)

    def test_finished_units_are_not_measured_again(self):
        self.stop_after(3)
        again = run(*self.words(self.config, self.out), fault=Fault("unit-", "rename", "count")).stderr
        self.assertIn("faults: counted 1 calls", again)
        self.assert_as_alone()

    def test_another_setting_takes_nothing_over(self):
        self.stop_after(2, "--seed", 5, "--visible", 0.5)
        run(*self.words(self.config, self.out))
        self.assert_as_alone()

    def test_a_picture_that_changed_is_measured_again(self):
        data = copy_folder(self.shared / "data", self.folder / "data")
        config = self.write_config(self.folder, data)
        self.stop_after(3, config=config)
        picture = data / "images/p000.png"
        ImageOps.invert(Image.open(picture)).save(picture)  # of the same size, so that only its bytes tell
        run(*self.words(config, self.out))
        run(*self.words(config, self.folder / "fresh"))
        self.assertEqual(digests(self.out), digests(self.folder / "fresh"))
        self.assertNotEqual(digests(self.out)["samples.csv"], digests(self.shared / "alone")["samples.csv"])

    def test_ranks_write_the_files_of_one_process(self):
        for ranks in (2, 3):
            all_ranks = self.start_ranks(ranks)
            self.assertEqual([rank.wait() for rank in all_ranks], [0] * ranks, [rank.stderr() for rank in all_ranks])
            self.assertIn("samples.csv", all_ranks[0].out.read_text())
            for other in all_ranks[1:]:
                self.assertEqual((other.out.read_text(), other.stderr()), ("", ""))
            self.assert_as_alone()
            shutil.rmtree(self.out)

    def test_ranks_that_the_program_starts_itself_write_the_files_of_one_process(self):
        self.assertIn("samples.csv", run(*self.words(self.config, self.out, "--ranks", 2)).stdout)
        self.assert_as_alone()

    def start_stopped(self, variables):
        """Two ranks that have stopped, each with a unit open. The launcher holds the store, since rank 0 stops too."""
        faults = {rank: Fault("unit-", "rename", "stop") for rank in range(2)}
        first, second = self.start_ranks(2, faults, variables)
        first.wait_for_fault()
        second.wait_for_fault()
        return first, second

    def test_a_killed_rank_loses_its_open_unit_only(self):
        store, variables = launcher_store()
        self.addCleanup(lambda: store)  # keeps it
        first, second = self.start_stopped(variables)
        second.send(signal.SIGKILL)
        first.send(signal.SIGCONT)
        self.assertEqual(first.wait(), 0, first.stderr())
        self.assert_as_alone()

    def test_a_rank_that_wakes_when_all_is_over_does_no_harm(self):
        store, variables = launcher_store()
        first, second = self.start_stopped(variables)
        first.send(signal.SIGCONT)
        self.assertEqual(first.wait(), 0, first.stderr())
        del store  # as under srun, where rank 0 holds it
        second.send(signal.SIGCONT)
        self.assertEqual(second.wait(), 0, second.stderr())
        self.assert_as_alone()

    def test_two_evaluations_into_one_folder_are_refused(self):
        with started(*self.words(self.config, self.out), fault=Fault("unit-", "rename", "stop")) as running:
            self.assertTrue(running.wait_for_stop())
            self.assertIn("is in use by another", run(*self.words(self.config, self.out), expect=1).stderr)
            running.send(signal.SIGCONT)
            self.assertEqual(running.wait(), 0)
        self.assert_as_alone()
