"""Files that were made to do harm: the program ends with a message or a verdict, in bounded memory and time."""

import json
import resource
import struct
import subprocess
import zlib

from e2e import (LIMIT_S, DrawnCase, Fault, command, environment, latest, make_network, prima_dataset, run,
                 split_safetensors, verdicts, write_annotations, write_json, write_safetensors)

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
