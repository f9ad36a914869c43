"""Fuzzes the readers of official files in tools/: importers_fuzz.py [--replay] FOLDER... [libFuzzer's options]

The first byte of an input names the reader: p a pickle and every table in it, z a pickle within a file of torch.save,
t a whole file of torch.save, s a safetensors file. A reader returns a value or refuses the file with one of its own
errors. With --replay, every file below the folders is read once, which ctest does; else atheris breeds inputs.
"""

import os
import pathlib
import sys
import tempfile
import zipfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "tools"))
REPLAYS = "--replay" in sys.argv
if not REPLAYS:
    import atheris

    # Modules that are imported here are watched for the branches that an input reaches.
    instrumented = atheris.instrument_imports(
        include=["pickle_machine", "pickle_names", "pickled_arrays", "prima_import", "prima_names", "restricted_pickle",
                 "safetensors_file", "torch_checkpoint", "zipfile"])  # fmt: skip
    instrumented.__enter__()
import pickled_arrays  # noqa: E402
import restricted_pickle  # noqa: E402
import safetensors_file  # noqa: E402
import torch_checkpoint  # noqa: E402

if not REPLAYS:
    instrumented.__exit__(None, None, None)

REFUSALS = (restricted_pickle.BrokenPickle, restricted_pickle.RefusedPickle, safetensors_file.TensorFileError)
WHERE = os.path.join(tempfile.mkdtemp(prefix="q3d_fuzz_"), "file.bin")


def require(holds, promise):
    if not holds:
        raise AssertionError(f"broken promise: {promise}")


def read_pickle(data):
    root = restricted_pickle.load(data, WHERE)
    fields = root.entries if isinstance(root, restricted_pickle.Record) else root
    for name, value in (fields if isinstance(fields, dict) else {"root": root}).items():
        try:
            table = pickled_arrays.matrix(value, str(name)[:40])
        except REFUSALS:
            continue
        require(table.size <= max(len(data), pickled_arrays.MAX_DENSE_ELEMENTS), "a table has a bounded size")


def read_torch(path):
    file = torch_checkpoint.TorchFile(path, check_sums=False)
    root = file.root.get("state_dict", file.root) if isinstance(file.root, dict) else file.root
    for name, tensor in file.tensors(root, "root").items():
        count = sum(len(bytes(chunk)) for chunk in tensor.chunks())
        require(count == tensor.byte_count, f"{name}: a tensor has as many bytes as its shape says")


def read_safetensors(path):
    size = os.path.getsize(path)
    tensors, metadata = safetensors_file.read(path)
    require(all(isinstance(value, str) for value in metadata.values()), "metadata is text")
    total = 0
    for tensor in tensors.values():
        total += sum(len(chunk) for chunk in tensor.chunks())
    require(total <= size, "tensors take no more than the file")


def write(data):
    with open(WHERE, "wb") as file:
        file.write(data)
    return WHERE


def write_zip(pickled):
    with zipfile.ZipFile(WHERE, "w") as archive:
        archive.writestr("file/data.pkl", pickled)
        archive.writestr("file/data/0", bytes(range(64)))
    return WHERE


def one_input(data):
    reader, data = data[:1], data[1:]
    try:
        if reader == b"p":
            read_pickle(data)
        elif reader == b"z":
            read_torch(write_zip(data))
        elif reader == b"t":
            read_torch(write(data))
        elif reader == b"s":
            read_safetensors(write(data))
    except REFUSALS as error:
        require(len(str(error)) < 2000, "a refusal is short")
        require(WHERE in str(error), f"a refusal names the file: {error}")


def replay(folders):
    files = sorted(file for folder in folders for file in pathlib.Path(folder).rglob("*") if file.is_file())
    for file in files:
        print(file, flush=True)  # before it is read, so that a failure is behind its file's name
        one_input(file.read_bytes())
    print(f"{len(files)} inputs")
    return 0 if files else 1


if __name__ == "__main__":
    if REPLAYS:
        sys.exit(replay([word for word in sys.argv[1:] if not word.startswith("-")]))
    atheris.Setup(sys.argv, one_input)
    atheris.Fuzz()
