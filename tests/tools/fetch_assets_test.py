"""Tests `make assets` against a hub that runs on this machine."""

import dataclasses
import hashlib
import http.server
import os
import pathlib
import shutil
import subprocess
import tempfile
import threading
import unittest
from unittest import mock

import support  # first of ours: it sets the path
import asset_terms
import fetch_assets
import prima_import
import safetensors_file
import smal_import

PRIMA, BIOCLIP = "/MLAdaptiveIntelligence/PRIMA/", "/imageomics/bioclip/"
BODY, FAMILIES = "my_smpl_00781_4_all.pkl", "my_smpl_data_00781_4_all.pkl"
POSE = "walking_toy_symmetric_pose_prior_with_cov_35parts.pkl"


class Hub(http.server.ThreadingHTTPServer):
    """Serves `files` ({path: content or HTTP status}) and records the requested paths in `asked`."""

    def __init__(self):
        super().__init__(("127.0.0.1", 0), _Handler)
        self.files = {}
        self.asked = []
        self.cut_short = False
        threading.Thread(target=self.serve_forever, daemon=True).start()

    def publish(self, repository, name, content, digest=None):
        """Publishes a large file. As on the real hub, the repository holds a pointer to it."""
        digest = digest or hashlib.sha256(content).hexdigest()
        pointer = f"version https://git-lfs.github.com/spec/v1\noid sha256:{digest}\nsize {len(content)}\n"
        self.files[f"{repository}raw/main/{name}"] = pointer.encode()
        self.files[f"{repository}resolve/main/{name}"] = content


class _Handler(http.server.BaseHTTPRequestHandler):
    def do_GET(self):
        self.server.asked.append(self.path)
        content = self.server.files.get(self.path, 404)
        self.send_response(content if isinstance(content, int) else 200)
        body = b"" if isinstance(content, int) else content
        self.send_header("Content-Length", str(len(body) + (9 if self.server.cut_short else 0)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *arguments):
        pass


class HubCase(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.official = self.folder / "official"
        self.hub = Hub()
        self.addCleanup(self.hub.server_close)
        self.addCleanup(self.hub.shutdown)
        self.replace(fetch_assets, "HUB", f"http://127.0.0.1:{self.hub.server_port}")
        # The importers have their own tests; here they only record how they were called.
        self.imported = []
        for module, name in (
            (prima_import, "import_checkpoint"),
            (smal_import, "import_body"),
            (smal_import, "import_priors"),
        ):
            self.replace(module, name, self.importer(name))
        for name in ("s1ckpt_inference.ckpt", BODY, FAMILIES, POSE):
            self.hub.publish(PRIMA, name, name.encode() * 1000)
        self.hub.files[BIOCLIP + "raw/main/open_clip_config.json"] = b"{}"
        self.hub.files[BIOCLIP + "resolve/main/open_clip_config.json"] = b"{}"

    def replace(self, target, name, value):
        patch = mock.patch.object(target, name, value)
        patch.start()
        self.addCleanup(patch.stop)

    def importer(self, name):
        def run(*arguments, **options):
            *sources, target, _ = arguments
            sources = [os.path.basename(path) for path in sources]
            self.imported.append((name, sources, options))
            safetensors_file.write(target, {}, {"imported_from": ", ".join(sources)})

        return run


class FetchTest(HubCase):
    def fetch(self, *options):
        self.imported.clear()
        self.hub.asked.clear()
        return support.run("fetch", "--folder", self.folder, "--accept-licences", *options)

    def test_downloads_verifies_and_imports(self):
        code, out, err = self.fetch()
        self.assertEqual((code, err), (0, ""))
        config = str(self.official / "open_clip_config.json")
        self.assertEqual(
            self.imported,
            [
                ("import_checkpoint", ["s1ckpt_inference.ckpt"], {"open_clip_config": config}),
                ("import_body", [BODY], {}),
                ("import_priors", [FAMILIES, POSE], {}),
            ],
        )
        self.assertEqual((self.official / BODY).read_bytes(), BODY.encode() * 1000)
        self.assertEqual(out.count(", as published"), 4)
        self.assertIn("open_clip_config.json: SHA-256 44136fa355b3678a", out)  # the SHA-256 of "{}"
        self.assertIn("at this first use, since no published digest is known", out)
        check = subprocess.run(["sha256sum", "-c", "sha256.lock"], cwd=self.official, capture_output=True, text=True)
        self.assertEqual((check.returncode, check.stdout.count(": OK")), (0, 5))
        self.assertEqual([name for name in os.listdir(self.official) if name.endswith(".part")], [])

    def test_a_second_run_asks_for_nothing(self):
        self.fetch()
        code, out, _ = self.fetch()
        self.assertEqual((code, self.hub.asked, self.imported), (0, [], []))
        self.assertEqual(out.count("up to date"), 3)
        os.utime(self.official / BODY, (2**31, 2**31))  # newer than what was made of it
        self.fetch()
        self.assertEqual([name for name, *_ in self.imported], ["import_body"])

    def test_another_stage_under_an_older_published_name(self):
        self.fetch()
        self.hub.publish(PRIMA, "s3ckpt.ckpt", b"stage 3")
        for options, source in ((("--stage", "3"), "s3ckpt.ckpt"), ((), "s1ckpt_inference.ckpt")):
            code, _, _ = self.fetch(*options)
            self.assertEqual((code, [entry[1] for entry in self.imported]), (0, [[source]]))

    def test_files_for_training(self):
        code, out, _ = self.fetch("--training")
        self.assertEqual(code, 1)
        self.assertIn("MLAdaptiveIntelligence/PRIMA has no file named amr_vitbb.pth", out)
        self.assertIn("open_clip_pytorch_model.bin: BioCLIP", out)

    def test_a_digest_that_is_not_the_published_one(self):
        self.hub.publish(PRIMA, BODY, b"replaced", digest="0" * 64)
        code, _, err = self.fetch()
        self.assertEqual(code, 1)
        self.assertIn(f"{BODY}: SHA-256 {hashlib.sha256(b'replaced').hexdigest()}, but its publisher states 0000", err)
        self.assertEqual(sorted(os.listdir(self.official)), ["s1ckpt_inference.ckpt", "sha256.lock"])

    def test_a_file_that_changed_since_its_first_use(self):
        self.fetch()
        with open(self.official / POSE, "ab") as file:
            file.write(b"!")
        code, _, err = self.fetch()
        self.assertEqual(code, 1)
        self.assertIn(f"{POSE}: SHA-256", err)
        self.assertIn("at its first use", err)
        self.assertEqual(self.imported, [])

    def test_without_a_network_it_says_what_goes_where(self):
        self.replace(fetch_assets, "HUB", "http://127.0.0.1:9")  # the discard port: nobody answers
        code, out, _ = self.fetch()
        self.assertEqual((code, self.imported), (1, []))
        self.assertIn("cannot be reached", out)
        for name in ("s1ckpt_inference.ckpt", BODY, FAMILIES, POSE):
            self.assertIn(f"{self.official / name}: ", out)
            (self.official / name).write_bytes(b"placed by hand")
        code, out, _ = self.fetch("--offline")
        self.assertEqual((code, len(self.imported), self.hub.asked), (0, 3, []))
        self.assertEqual(out.count("at this first use, since no published digest is known"), 4)
        self.assertEqual(self.imported[0][2], {"open_clip_config": None})

    def test_connections_that_break_leave_no_file(self):
        self.hub.cut_short = True
        code, out, _ = self.fetch()
        self.assertEqual((code, self.imported), (1, []))
        self.assertRegex(out, "the connection (broke|ended) after")
        self.assertEqual(os.listdir(self.official), [])

    def test_files_behind_a_login(self):
        for path in [path for path in self.hub.files if "s1ckpt" in path]:
            self.hub.files[path] = 401
        code, out, _ = self.fetch()
        self.assertEqual((code, [name for name, *_ in self.imported]), (1, ["import_body", "import_priors"]))
        self.assertIn("answers 401", out)


class TermsTest(HubCase):
    """Nothing is fetched or imported before the user accepts the terms."""

    def fetch(self, *options, terminal=False, answer=None):
        """A run without --accept-licences. answer: what the user types at the terminal; None stands for Ctrl-D."""
        self.imported.clear()
        self.hub.asked.clear()
        self.questions = []

        def ask(question):
            self.questions.append(question)
            if answer is None:
                raise EOFError
            return answer

        with mock.patch("builtins.input", ask), mock.patch("sys.stdin", mock.Mock(isatty=lambda: terminal)):
            return support.run("fetch", "--folder", self.folder, *options)

    def assert_nothing_happened(self):
        self.assertEqual((self.hub.asked, self.imported, os.listdir(self.folder)), ([], [], []))

    def test_without_a_terminal_it_stops_and_says_how_to_consent(self):
        for options in ((), ("--offline",)):
            code, out, err = self.fetch(*options)
            self.assertEqual(code, 2)
            self.assertIn("Max Planck Institute for Intelligent Systems", out)
            self.assertIn("no terminal to ask at", err)
            self.assertIn("make assets ACCEPT_LICENCES=1", err)
            self.assertEqual(self.questions, [])
            self.assert_nothing_happened()

    def test_owner_and_conditions_of_every_file(self):
        _, out, _ = self.fetch()
        for mention in (
            "s1ckpt*.ckpt",
            "Mackenzie Mathis, Xiaohang Yu and contributors",
            "academic, non-commercial use only",
            "my_smpl_*.pkl",
            "non-commercial scientific research only; no redistribution",
            "register",
            "https://smal.is.tue.mpg.de/license.html",
            "open_clip_config.json",
            "datasets of SMAL parameters) inherits their\nconditions",
        ):
            self.assertIn(mention, out)
        self.assertNotIn("AniMer", out)
        self.assertIn("AniMer", self.fetch("--training")[1])

    def test_a_user_who_does_not_accept(self):
        for answer in ("no", "", "n", "yes, but", None):
            code, _, err = self.fetch(terminal=True, answer=answer)
            self.assertEqual((code, len(self.questions)), (1, 1))
            self.assertIn("you did not accept the terms", err)
            self.assert_nothing_happened()

    def test_a_user_who_accepts_is_asked_once(self):
        for answer in ("yes", " Y "):
            code, out, _ = self.fetch(terminal=True, answer=answer)
            self.assertEqual((code, len(self.questions), len(self.imported)), (0, 1, 3))
            record = self.folder / "accepted-terms.txt"
            self.assertIn(f"recorded in {record}", out)
            self.assertEqual(len(record.read_text().splitlines()), 3)
            code, out, _ = self.fetch()
            self.assertEqual((code, self.questions), (0, []))
            self.assertNotIn("Max Planck", out)
            shutil.rmtree(self.folder)

    def test_only_new_terms_are_asked_for(self):
        self.fetch("--accept-licences")
        code, out, _ = self.fetch("--training")
        self.assertEqual(code, 2)
        self.assertIn("AniMer", out)
        self.assertNotIn("Max Planck", out)
        changed = dataclasses.replace(asset_terms.SMAL, conditions="ask first")
        self.replace(asset_terms, "SMAL", changed)
        code, out, _ = self.fetch()
        self.assertEqual(code, 2)
        self.assertIn("ask first", out)
        self.assertNotIn("Mackenzie", out)

    def test_consent_on_the_command_line_in_both_spellings(self):
        for option in ("--accept-licences", "--accept-licenses"):
            code, out, _ = self.fetch(option)
            self.assertEqual((code, len(self.imported), self.questions), (0, 3, []))
            self.assertIn("non-commercial scientific research only", out)
            shutil.rmtree(self.folder)


if __name__ == "__main__":
    unittest.main()
