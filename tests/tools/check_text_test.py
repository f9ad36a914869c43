"""tools/check_text.py on single files."""

import os
import pathlib
import tempfile
import unittest

import support  # noqa: F401  sets the path
import check_text


class CheckText(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.addCleanup(os.chdir, os.getcwd())
        os.chdir(scratch.name)

    def faults(self, name, content):
        path = pathlib.Path(name)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
        return check_text.faults(name)

    def test_good_files(self):
        self.assertEqual(self.faults("a.cpp", b"int x;\n"), [])
        self.assertEqual(self.faults("a.md", b"[a](a.cpp), [b](https://example.org), [c](#part), `[d](e)`\n"), [])
        self.assertEqual(self.faults("a.json", b'{ "a": 1 }\n'), [])
        self.assertEqual(self.faults("a.jpg", b"\xff\xd8\xff \n"), [])
        self.assertEqual(self.faults("Makefile", b"a:\n\tb\n"), [])

    def test_each_fault(self):
        for name, content, expected in (
            ("a.cpp", b"int x; \n", ["a.cpp:1: spaces at the end of the line"]),
            ("a.cpp", b"int x;\r\n", ["a.cpp:1: a Windows line end"]),
            ("a.cpp", b"\n\tint x;\n", ["a.cpp:2: a tab"]),
            ("a.cpp", b"int x;", ["a.cpp:1: no line end at the end of the file"]),
            ("a.cpp", b"<<<<<<< HEAD\n", ["a.cpp:1: a leftover of a merge"]),
            ("a.cpp", b"// \xe9\n", ["a.cpp: not UTF-8"]),
            ("b/a.md", b"[a](a.cpp#part)\n", ["b/a.md: the link to a.cpp leads nowhere"]),
            ("a.bin", b"\0" * 1000001, ["a.bin: 1000001 bytes, expected at most 1000000"]),
        ):
            with self.subTest(content=content[:20]):
                self.assertEqual(self.faults(name, content), expected)
        self.assertIn("not valid JSON", self.faults("a.json", b'{ "a": }\n')[0])


if __name__ == "__main__":
    unittest.main()
