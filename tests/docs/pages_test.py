"""Pages that repeat what the sources say: they have to say the same."""

import json
import pathlib
import re
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
SOURCES = ("manifests", "loaders", "smal", "model", "filters", "pipeline")


def source_with(text: str) -> str:
    """The one source file that has this text in it, wherever it lies."""
    found = [content for folder in SOURCES for path in sorted((ROOT / folder).rglob("*.cpp"))
             if text in (content := path.read_text())]
    assert len(found) == 1, f"{len(found)} sources have {text!r}, expected 1"
    return found[0]


def table(page: str, heading: str) -> list[list[str]]:
    """The cells of the first table below a heading, without code marks, without the header."""
    section = (ROOT / "docs" / page).read_text().split(f"\n## {heading}\n")[1].split("\n## ")[0]
    lines = [line for line in section.splitlines() if line.startswith("|")]
    return [[cell.strip().replace("`", "") for cell in line.strip("|").split("|")] for line in lines[2:]]


def literals() -> str:
    """All text of the sources, with string literals that go on over several lines joined and unescaped."""
    paths = [path for folder in (*SOURCES, "tools", "cmake") for path in (ROOT / folder).rglob("*")
             if path.suffix in (".cpp", ".h", ".py", ".sh", ".cmake")]
    text = "\n".join(path.read_text() for path in paths)
    text = re.sub(r'"\s*\n\s*"', "", text).replace('\\"', '"')
    return text.replace("{{", "{").replace("}}", "}")


class BodyPage(unittest.TestCase):
    def test_keypoints_are_those_of_the_topology(self):
        source = source_with("Topology animal3d26()").split("Topology animal3d26()")[1].split("\n}\n")[0]
        header = (ROOT / "manifests" / "keypoint_names.h").read_text()
        names = re.findall(r'"([a-z_]+)"', header.split("kKeypointNames{")[1].split("}")[0])
        mirror = {}
        for left, right in re.findall(r"\{(\d+), (\d+)\}", source):
            mirror[int(left)], mirror[int(right)] = right, left
        expected = [[str(i), name, mirror.get(i, "")] for i, name in enumerate(names)]
        self.assertEqual(len(expected), 26)
        self.assertEqual([row[:3] for row in table("body.md", "The 26 keypoints")], expected)
        vertices = json.loads((ROOT / "tools" / "keypoint_vertices.json").read_text())["keypoints"]
        self.assertEqual([group["name"] for group in vertices], names)

    def test_the_shard_format_lists_them_in_order(self):
        page = (ROOT / "docs" / "shard-format.md").read_text()
        section = page.split("\n### The order of the 26 keypoints\n")[1].split("\n## ")[0]
        rows = [[cell.strip(" `") for cell in line.strip("|").split("|")]
                for line in section.splitlines() if line.startswith("|")][2:]
        listed = {int(row[0]): row[1] for row in rows}
        vertices = json.loads((ROOT / "tools" / "keypoint_vertices.json").read_text())["keypoints"]
        self.assertEqual(listed, {i: group["name"] for i, group in enumerate(vertices)})

    def test_joints_are_those_of_the_skeleton(self):
        source = source_with("kJoints = {{").split("kJoints = {{")[1].split("}};")[0]
        joints = re.findall(r'\{"([a-z_0-9]+)", (-?\d+), Part::', source)
        expected = [[str(i), name, "none" if parent == "-1" else parent]
                    for i, (name, parent) in enumerate(joints)]
        self.assertEqual(len(expected), 35)
        rows = [[row[0], row[1], row[3]] for row in table("body.md", "The 35 joints")]
        self.assertEqual(rows, expected)

    def test_families_are_in_order(self):
        source = source_with("EnumNames kFamilies(").split("EnumNames kFamilies(")[1].split("{")[1].split("}")[0]
        names = re.findall(r'"([a-z]+)"', source)[1:]  # the first is "none", -1
        rows = table("body.md", "Shape")
        self.assertEqual([[row[0], row[1].lower()] for row in rows[:-1]], [[str(i), n] for i, n in enumerate(names)])
        self.assertEqual(rows[-1][0], "-1")


class TroubleshootingPage(unittest.TestCase):
    def test_every_reason_is_explained_once(self):
        source = source_with("EnumNames kReasons(").split("EnumNames kReasons(")[1].split("{")[1].split("}")[0]
        names = re.findall(r'"([a-z_]+)"', source)
        self.assertEqual(names[0], "none")
        rows = table("troubleshooting.md", "Many candidates failed")
        rows += table("troubleshooting.md", "Many candidates were discarded")
        explained = [name for row in rows for name in re.split(r",\s*", row[0])]
        self.assertEqual(sorted(explained), sorted(names[1:]))

    def test_quoted_messages_are_those_of_the_program(self):
        page = (ROOT / "docs" / "troubleshooting.md").read_text()
        messages = re.findall(r"^\*\*`(.*?)`\*\*", page, re.MULTILINE)
        self.assertGreater(len(messages), 30)
        sources = literals()
        of_the_system = ("No space left on device", "Could NOT find")
        for message in messages:
            text = re.sub(r"^(setup|warning): ", "", message).replace("'", "`")
            parts = [part.strip(" :.") for part in text.split("...")]
            for part in parts:
                if len(part) < 12 or part.startswith(of_the_system):
                    continue
                with self.subTest(message=message):
                    self.assertTrue(part in sources or part.replace("`", "'") in sources, f"no source says {part!r}")


if __name__ == "__main__":
    unittest.main()
