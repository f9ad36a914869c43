"""Files that were made to do harm: the program ends with a message or a verdict, in bounded memory and time."""

import hashlib
import json
import resource
import shutil
import struct
import subprocess
import zlib

from e2e import (LIMIT_S, DrawnCase, Fault, command, environment, file_sha256, latest, make_network, prima_dataset,
                 read_byte_column, run, seal_json, split_safetensors, verdicts, write_annotations, write_json,
                 write_safetensors)

MEGA = 1 << 20
LEVELS = 100_000


def chunk(kind, body):
    return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))


def png_that_claims(width, height):
    """A sound PNG of few bytes, but for its size."""
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(bytes(1000))) + chunk(b"IEND", b""))


def jpeg_that_claims(width, height):
    """The head of a progressive JPEG, for which a decoder keeps all coefficients in memory."""
    frame = struct.pack(">BHHB", 8, height, width, 3) + b"".join(bytes((i, 0x11, 0)) for i in (1, 2, 3))
    tables = b"\xff\xdb" + struct.pack(">H", 67) + b"\0" + bytes([1] * 64)
    scan = b"\xff\xda" + struct.pack(">HB", 12, 3) + b"\x01\0\x02\0\x03\0" + b"\0\0\0" + bytes(100)
    return b"\xff\xd8" + tables + b"\xff\xc2" + struct.pack(">H", 2 + len(frame)) + frame + scan + b"\xff\xd9"


class Hostile(DrawnCase):
    def setUp(self):
        super().setUp()
        self.data = self.copy_of("data")
        self.config = write_json(self.folder / "config.json",
                                 {"name": "drawn", "datasets": [prima_dataset(self.data, role="2d_only")]})

    def bounded(self, *words, expect, megabytes=1500, seconds=120):
        """Runs the program; it may take so much processor time and so much memory beyond what an idle one takes."""
        def limit():
            resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))

        code = ("import resource, subprocess, sys; code = subprocess.run(sys.argv[1:]).returncode; "
                "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss, file=sys.stderr); sys.exit(code)")
        result = subprocess.run(["python3", "-c", code, *command(words)], capture_output=True, text=True,
                                env=environment(), timeout=LIMIT_S, preexec_fn=limit)
        self.assertEqual(result.returncode, expect, result.stderr[-3000:])
        peak_mb = int(result.stderr.splitlines()[-1]) / 1024
        self.assertLess(peak_mb, megabytes)
        return result.stderr

    def build(self, *more, expect=0, **limits):
        return self.bounded("build", "--config", self.config, "--out", self.folder / "out", *more, expect=expect, **limits)

    def deep(self, levels=LEVELS):
        return ("[" * levels + "]" * levels, '{"a":' * levels + "1" + "}" * levels, "[" * levels)

    def test_json_of_many_levels(self):
        for text in self.deep():
            with self.subTest(start=text[:5], end=text[-1]):
                (self.data / "train.json").write_text(text)
                self.assertIn("train.json", self.build(expect=1))
                (self.data / "train.json").write_text('{"data": [' + text + "]}")
                self.assertIn("train.json", self.build(expect=1))
                broken = self.folder / "deep.json"
                broken.write_text(text)
                for words in (["build", "--config", broken, "--out", self.folder / "out"],
                              ["build", "--config", self.config, "--set", f"tta={text[:90_000]}", "--out", self.folder / "x"]):
                    self.bounded(*words, expect=2)
                self.bounded("topology", "--from", broken, expect=1)

    def test_json_of_many_levels_in_what_the_program_wrote_before(self):
        out = self.copy_of("out")
        deep = self.deep()[1]
        plan, = (out / "stages/builds").glob("*.json")
        plan.write_text(deep)
        self.assertIn("damaged", self.bounded("status", out, expect=0))
        (out / "stages/exports").mkdir()
        (out / "stages/exports/coco-1.json").write_text(deep)
        self.assertIn("damaged", self.bounded("status", out, expect=0))
        (self.folder / "coco").mkdir()
        (self.folder / "coco/export.json").write_text(deep)
        self.bounded("export", out, "--format", "coco", "--out", self.folder / "coco", expect=1)
        (latest(out) / "dataset.json").chmod(0o644)
        (latest(out) / "dataset.json").write_text(deep)
        for command_name in ("verify", "inspect", "explain", "report"):
            words = [command_name, out, *(["p001"] if command_name == "explain" else [])]
            self.assertIn("dataset.json", self.bounded(*words, expect=1))

    def test_long_texts_and_numbers(self):
        records = json.loads((self.data / "train.json").read_text())["data"]
        records[0]["img_path"] = "x" * (100 * MEGA)
        write_annotations(self.data, records)
        self.build()
        row = verdicts(latest(self.folder / "out"))[0]
        self.assertEqual((row["reason"], len(row["id"]) < 400), ("record_malformed", True))
        text = json.dumps({"data": json.loads((self.shared / "data/train.json").read_text())["data"]})
        for number in ("9" * MEGA, "0." + "3" * MEGA, "1e" + "9" * 1000, "-" + "1" * MEGA + "e-" + "9" * 1000):
            (self.data / "train.json").write_text(text.replace('"bbox": [', f'"bbox": [{number}, ', 1))
            self.build("--set", f"version=1.0.{len(number)}")

    def test_pictures_that_claim_to_be_large(self):
        records = json.loads((self.data / "train.json").read_text())["data"]
        for name, content in (("claims.png", png_that_claims(50_000, 50_000)), ("claims.jpg", jpeg_that_claims(50_000, 50_000)),
                              ("most.png", png_that_claims(2**31 - 1, 2**31 - 1)), ("wide.jpg", jpeg_that_claims(65_500, 3_100))):
            (self.data / "images" / name).write_bytes(content)
            records.append({**records[0], "img_path": f"images/{name}"})
        write_annotations(self.data, records)
        self.build()
        rows = verdicts(latest(self.folder / "out"))
        self.assertEqual([row["verdict"] for row in rows], ["retained"] * 3 + ["failed"] * 4)
        for row in (rows[3], rows[4], rows[6]):
            self.assertEqual(row["reason"], "image_too_large", row)
        self.assertIn("expected at most 200 megapixels (max_picture_megapixels)", rows[3]["detail"])

    def test_a_limit_of_pixels_that_the_config_sets(self):
        size = json.loads(run("inspect", self.shared / "out", "--json").stdout)
        self.assertTrue(size)
        self.build("--set", "datasets.drawn.max_picture_megapixels=0.001", expect=1)
        rows = verdicts(next((self.folder / "out").glob("drawn-*")))
        self.assertEqual({row["reason"] for row in rows}, {"image_too_large"})

    def test_weights_that_lie_about_their_sizes(self):
        network, body = self.folder / "tiny.safetensors", self.folder / "smal.safetensors"
        make_network(network, seed=1, body=body)
        header, data = split_safetensors(network)
        name = next(key for key in header if key.endswith("decpose.0.weight"))
        config = write_json(self.folder / "network.json", {
            "name": "drawn", "datasets": [prima_dataset(self.data)], "filter": {"tau_low": 0.01, "tau_high": 0.02},
            "network": {"checkpoint": str(network), "smal_asset": str(body), "device": "cpu"}})
        for change in ({"shape": [1 << 40, 1 << 20]}, {"shape": [1 << 62, 4]}, {"data_offsets": [0, 1 << 50]},
                       {"data_offsets": [1 << 63, 1 << 63]}, {"shape": [-1]}, {"shape": [1.5]}, {"dtype": "F4096"}):
            with self.subTest(change=change):
                write_safetensors(network, {**header, name: {**header[name], **change}}, data)
                self.assertIn("tiny.safetensors", self.bounded("build", "--config", config, "--out", self.folder / "out",
                                                               expect=1))
        for length in (1 << 62, (1 << 64) - 1, 99_999_999):
            network.write_bytes(struct.pack("<Q", length) + b"{}")
            self.assertIn("tiny.safetensors", self.bounded("build", "--config", config, "--out", self.folder / "out",
                                                           expect=1))

    def test_names_of_pictures_that_lead_out_of_the_root(self):
        """However a name is spelled, the picture outside is never read."""
        secret = self.folder / "secret.png"
        shutil.copy(self.data / "images/p002.png", secret)
        (self.data / "images/p002.png").unlink()
        images = self.data / "images"
        (images / "link.png").symlink_to(secret)
        (images / "up").symlink_to(self.folder)
        windows = str(secret).replace("/", "\\")
        names = ["../secret.png", "images/../../secret.png", str(secret), "images/link.png", "images/up/secret.png",
                 "images/p000.png\0", "../secret.png\0.png", "..\\secret.png", "images\\..\\..\\secret.png",
                 f"C:{windows}", f"c:{secret}", f"\\\\server\\share{windows}", f"\\\\?\\C:{windows}",
                 f"file://{secret}", "%2e%2e/secret.png", "..%2fsecret.png", "..%5csecret.png",
                 "....//....//secret.png", "images/up/../secret.png", "\u2025/secret.png", ""]
        records = json.loads((self.data / "train.json").read_text())["data"]
        changes = [{"img_path": name} for name in names] + [{"mask_path": name} for name in names if name]
        for i, change in enumerate(changes):
            points = [[x + i / 8, y, v] for x, y, v in records[0]["keypoint_2d"]]  # else they are duplicates
            changes[i] = {**records[0], "keypoint_2d": points, **change}
        write_annotations(self.data, changes)
        self.build("--set", "max_failed_share=1")
        dataset = latest(self.folder / "out")
        rows = verdicts(dataset)
        self.assertNotIn(file_sha256(secret), {row["image_sha256"] for row in rows})
        for change, row in zip(changes[: len(names)], rows):
            self.assertEqual(row["verdict"], "failed", (change["img_path"], row))
            self.assertIn(row["reason"], ("path_escapes_root", "image_missing", "record_malformed"), row)
        self.assertEqual(set(read_byte_column(dataset, "crop_mask")), {b""})

    def stranger(self, name, change):
        """A copy of the finished dataset with a change of dataset.json, whose digest is right."""
        folder = shutil.copytree(latest(self.shared / "out"), self.folder / name / "drawn-000000000000")
        file = folder / "dataset.json"
        document = json.loads(file.read_text())
        change(document)
        file.chmod(0o644)
        file.write_text(seal_json(document))
        return folder

    def files(self):
        return {path for path in self.folder.rglob("*")}

    def test_names_in_dataset_json_that_lead_elsewhere(self):
        def named(name):
            return lambda document: document.update(name=name)

        def shard(name):
            return lambda document: document["shards"][0].update(file=name)

        def key(value):
            return lambda document: document["provenance"]["stage_keys"].update(predict=value)

        other = latest(self.copy_of("out"))
        cases = [(named, name) for name in ("../escaped", "/tmp/escaped", "a/b", "..", "a\0b", "a\\b", "")]
        cases += [(shard, name) for name in ("../x.h5", "shards/../../x.h5", "/x.h5", "shards/a\0.h5", "shards\\x.h5")]
        cases += [(key, text) for text in ("/../../../xx", "a/b", "..")]
        for i, (change, text) in enumerate(cases):
            folder = self.stranger(f"s{i}", change(text))
            before = self.files()
            out = ["--out", self.folder / f"s{i}" / "new"]
            commands = [["inspect", folder], ["subset", folder, "--where", "verdict = retained", *out]]
            if text in ("../escaped", "../x.h5"):
                commands += [["verify", folder], ["explain", folder, "p001"], ["report", folder], ["diff", folder, other],
                             ["merge", folder, other, *out], ["export", folder, "--format", "coco", *out]]
            for words in commands:
                with self.subTest(change=text, command=words[0]):
                    self.assertIn("dataset.json", self.bounded(*words, expect=1))
            self.assertEqual(self.files() - before, set())

    def test_names_in_an_export_that_lead_elsewhere(self):
        out = self.copy_of("out")
        run("export", out, "--format", "coco", "--out", self.folder / "coco")
        file = self.folder / "coco/export.json"
        manifest = json.loads(file.read_text())
        secret = self.folder / "secret.txt"
        secret.write_text("secret")
        digest = hashlib.sha256(b"secret").hexdigest()
        for name in ("../secret.txt", str(secret), "images/../../secret.txt", "a\0", "", "..", "..\\secret.txt"):
            for part in ("files", "picture_files"):
                file.write_text(json.dumps({**manifest, part: [{"file": name, "bytes": 6, "sha256": digest}]}))
                message = self.bounded("export", out, "--format", "coco", "--out", self.folder / "coco", expect=1)
                self.assertIn("export.json", message)
                self.bounded("status", out, expect=0)
        for text in ("[]", "{}", '{"files": 1}', json.dumps({**manifest, "files": {"a": 1}}),
                     json.dumps({**manifest, "files": [1]}), json.dumps({**manifest, "picture_files": [{"file": 1}]})):
            file.write_text(text)
            result = run("export", out, "--format", "coco", "--out", self.folder / "coco", expect=None)
            self.assertIn(result.returncode, (1, 2), text)
            self.assertIn("export.json", result.stderr)
            self.bounded("status", out, expect=0)

    def test_files_of_earlier_runs_with_values_of_other_types(self):
        """Each is JSON as a reader expects it, but for the type of one value."""
        out = self.copy_of("out")
        run("report", out)
        folder = out / "report" / latest(out).name
        for name in ("manifest.json", "tsne.json"):
            for text in ("[]", '{"key": 1}', '{"content_id": 1}', '{"key": "x", "files": 3}', "1", '{"files": []}'):
                (folder / name).write_text(text)
                self.bounded("report", out, expect=0)
        world = self.folder / "world"
        world.mkdir()
        for text in ("[]", "{}", '{"options": 1}'):
            (world / "world.json").write_text(text)
            self.assertIn("world", self.bounded("sample", "--out", world, "--share", 0.01, expect=1))

    def test_pages_show_names_as_text(self):
        """A picture and a species whose names are HTML."""
        attack = "<img src=x onerror=alert(1)>"
        records = json.loads((self.data / "train.json").read_text())["data"]
        for i, record in enumerate(records):
            name = f"images/p{i}{attack.replace('/', '')}&amp;\"'.png"
            shutil.copy(self.data / record["img_path"], self.data / name)
            record.update(img_path=name, species=f"</script>{attack}", source=attack)
        write_annotations(self.data, records)
        shutil.copytree(self.data, self.folder / "test set")
        config = {**json.loads(self.config.read_text()),
                  "leakage": {"test_sets": [prima_dataset(self.folder / "test set", name="tests", split="test")]}}
        self.config.write_text(json.dumps(config))
        self.build()
        self.bounded("report", self.folder / "out", expect=0)
        self.bounded("leakage", "--config", self.config, "--out", self.folder / "leakage", expect=0)
        pages = list(self.folder.rglob("*.html"))
        self.assertGreaterEqual(len(pages), 2, pages)
        for page in pages:
            text = page.read_text()
            self.assertIn("onerror", text, page)  # else the page shows no names
            self.assertNotIn("<img src=x", text, page)
            self.assertNotIn(f"</script>{attack[:4]}", text, page)

    def test_a_shard_of_a_stranger(self):
        """A stranger makes dataset.json and its digests too, so that only the file's own claims can tell."""
        out = self.copy_of("out")
        shard = latest(out) / "shards/000000.h5"
        content = bytearray(shard.read_bytes())
        shard.chmod(0o644)
        for at in range(96, len(content), max(1, len(content) // 40)):
            damaged = bytearray(content)
            damaged[at : at + 8] = b"\xff" * 8
            shard.write_bytes(damaged)
            result = subprocess.run(command(["inspect", shard]), capture_output=True, text=True, env=environment(),
                                    timeout=LIMIT_S)
            self.assertIn(result.returncode, (0, 1), (at, result.stderr))

    def test_a_library_that_crashes_over_a_shard_does_not_end_the_program(self):
        """Whoever opens the shard first is killed. The program opens it itself, then lets another process read it."""
        shard = latest(self.shared / "out") / "shards/000000.h5"
        codes = []
        for skip in range(4):
            result = run("inspect", shard, expect=None, fault=Fault("000000.h5", "open", "kill", skip=skip))
            codes.append(result.returncode)
            if result.returncode == 1:
                self.assertIn("000000.h5: the library that reads it crashed", result.stderr)
        self.assertIn(1, codes)
