"""Builds that are interrupted, paused or watched: signals, readers beside a build, and too little success."""

import os
import signal
import subprocess

from e2e import (LIMIT_S, Fault, Scene, SceneCase, alarm_seconds, command, digests, draw_pictures, environment, latest,
                 prima_dataset, run, started, write_annotations)


class Interruptions(SceneCase):
    @classmethod
    def prepare(cls):
        Scene.make(cls.shared).build("out")

    def setUp(self):
        super().setUp()
        self.dataset = latest(self.shared / "out")

    def test_each_signal_has_its_exit_code(self):
        first_line = Fault("journal.jsonl", "sync", "stop")
        for number, code in ((signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)):
            with self.subTest(signal=number):
                out = f"signal{code}"
                with started(*self.scene.build_words(out), fault=first_line) as build:
                    self.assertTrue(build.wait_for_stop())
                    build.send(number)
                    build.send(signal.SIGCONT)
                    self.assertEqual(build.wait(), code, build.stderr())
                    seconds, = alarm_seconds(build.stderr())
                    self.assertTrue(0 < seconds < 10, seconds)
                with started(*self.scene.build_words(out), fault=Fault(".h5.", "sync", "hang")) as build:
                    build.wait_for_line("faults: hang at sync")
                    build.send(number)
                    build.send(number)  # a second signal ends the program at once
                    self.assertEqual(build.wait(), code, build.stderr())
                self.scene.build(out)
                self.assertEqual(digests(self.scene.latest(out)), digests(self.dataset))

    def test_nohup_keeps_a_build_alive(self):
        """A terminal that is closed sends SIGHUP to all its programs, and nohup tells them to ignore it."""
        words = ["nohup", *command(self.scene.build_words("nohup"))]
        env = environment(Fault("journal.jsonl", "sync", "stop"))
        with open(os.devnull) as null, subprocess.Popen(words, stdin=null, stdout=subprocess.DEVNULL,
                                                        stderr=subprocess.DEVNULL, env=env) as build:
            os.waitid(os.P_PID, build.pid, os.WSTOPPED)
            build.send_signal(signal.SIGHUP)
            build.send_signal(signal.SIGCONT)
            self.assertEqual(build.wait(timeout=LIMIT_S), 0)
        self.assertEqual(digests(self.scene.latest("nohup")), digests(self.dataset))

    def test_a_build_that_is_stopped_for_a_while_goes_on(self):
        """SIGSTOP, as Ctrl-Z and batch systems send it, in the middle of several units."""
        with started(*self.scene.build_words("paused"), fault=Fault(".h5.", "sync", "stop", skip=2)) as build:
            self.assertTrue(build.wait_for_stop())
            for _ in range(3):
                build.send(signal.SIGCONT)
                build.send(signal.SIGSTOP)
            build.send(signal.SIGCONT)
            self.assertEqual(build.wait(), 0, build.stderr())
        self.assertEqual(digests(self.scene.latest("paused")), digests(self.dataset))

    def test_a_reader_keeps_what_it_reads_while_a_build_publishes(self):
        """A build publishes another version. `latest` always names a whole dataset, and the version of before stays."""
        self.scene.build("readers")
        before = self.scene.latest("readers")
        config = self.scene.write_config("second.json", version="1.0.1")
        point = Fault("latest", "rename", "stop")
        with started(*self.scene.build_words("readers", config=config), fault=point) as build:
            self.assertTrue(build.wait_for_stop())
            self.assertEqual(self.scene.latest("readers"), before)
            run("verify", self.folder / "readers")
            build.send(signal.SIGCONT)
            self.assertEqual(build.wait(), 0, build.stderr())
        self.assertNotEqual(self.scene.latest("readers"), before)
        for version in (before, self.scene.latest("readers")):
            run("verify", version)

    def test_too_little_success_leaves_latest_where_it_was(self):
        """Of twelve pictures eleven lie on a disk that is not mounted."""
        data = self.folder / "few"
        records = draw_pictures(data, 12, seed=5)
        config = self.scene.write_config("few.json", datasets=[prima_dataset("few", "few", role="2d_only")])
        write_annotations(data, records)
        self.scene.build("few_out", config=config)
        before = self.scene.latest("few_out")
        for picture in sorted((data / "images").iterdir())[1:]:
            picture.unlink()
        said = self.scene.build("few_out", config=config, expect=1).stderr
        self.assertIn("11 of 12 candidates failed", said)
        self.assertIn("max_failed_share", said)
        self.assertEqual(self.scene.latest("few_out"), before)
        self.scene.build("few_out", "--set", "max_failed_share=1", config=config)
        self.assertNotEqual(self.scene.latest("few_out"), before)
