#!/usr/bin/env python3
"""Makes a file of LPIPS weights for `--lpips` of `train` and `ghand evaluate`.

    pip install lpips torchvision
    python scripts/lpips_weights.py --out alex.safetensors [--half]

AlexNet's weights are torchvision's, which it downloads when it is first asked for them; the linear layers are those of
the `lpips` package, version 0.1. With `--backbone FILE` (torchvision's `.pth` file of AlexNet) neither torch nor
torchvision is needed, with `--linear FILE` the package `lpips` is not needed: only NumPy. The programs contain what
`--half` makes, under the licences of both packages (`assets/lpips`).

The file is a safetensors file, F32, with `--half` the convolutions' weights F16: the convolutions under torchvision's
names (`features.0.weight`, `features.0.bias`, ...), the channel weights of each compared layer as `linear.0`, ..., and
optionally `lpips_backbone` (`alex`) and `lpips_version` (`0.1`) in the metadata.
"""

import argparse
import importlib.util
import json
import os
import pickle
import struct
import sys
import zipfile
from collections import OrderedDict
from pathlib import Path

import numpy as np

# Indices of the convolutions in torchvision's `features`, and channels of the compared layers.
CONVOLUTIONS = ["0", "3", "6", "8", "10"]
CHANNELS = [64, 192, 384, 256, 256]
STORAGES = {"FloatStorage": "<f4", "DoubleStorage": "<f8", "HalfStorage": "<f2", "LongStorage": "<i8"}


class WrongFile(Exception):
    """A message for the user."""


def rebuild_tensor(storage, offset, size, stride, *_):
    """A view of a storage, as torch._utils._rebuild_tensor_v2 makes it."""
    last = offset + sum((n - 1) * step for n, step in zip(size, stride))
    if offset < 0 or min(stride, default=0) < 0 or min(size, default=1) < 1 or last >= len(storage):
        raise WrongFile("a tensor lies outside of its storage")
    strides = [step * storage.itemsize for step in stride]
    return np.lib.stride_tricks.as_strided(storage[offset:], size, strides, writeable=False)


class TensorUnpickler(pickle.Unpickler):
    """Reads state dictionaries of PyTorch without torch, and executes nothing else."""

    def __init__(self, file, storage):
        super().__init__(file)
        self.storage = storage

    def find_class(self, module, name):
        if (module, name) == ("collections", "OrderedDict"):
            return OrderedDict
        if (module, name) == ("torch._utils", "_rebuild_tensor_v2"):
            return rebuild_tensor
        if (module, name) == ("torch._utils", "_rebuild_parameter"):
            return lambda tensor, *_: tensor
        if module == "torch" and name in STORAGES:
            return np.dtype(STORAGES[name])
        raise WrongFile(f"it contains {module}.{name}, which no state dictionary of tensors needs")

    def persistent_load(self, saved):
        kind, dtype, key, _, count = saved[:5]
        if kind != "storage":
            raise WrongFile(f"it contains a {kind}")
        return self.storage(dtype, key, count)


def read_zip(file):
    """A file of PyTorch 1.6 or newer."""
    with zipfile.ZipFile(file) as archive:
        names = [name for name in archive.namelist() if name.endswith("/data.pkl")]
        if len(names) != 1:
            raise WrongFile("it has no data.pkl")
        folder = names[0].removesuffix("data.pkl")

        def storage(dtype, key, count):
            return np.frombuffer(archive.read(f"{folder}data/{key}"), dtype, count)

        with archive.open(names[0]) as content:
            return TensorUnpickler(content, storage).load()


def read_legacy(file):
    """A file of an older PyTorch: the numbers of all storages follow the dictionary."""
    storages = {}

    def storage(dtype, key, count):
        return storages.setdefault(key, np.zeros(count, dtype))

    # A magic number, the version of the format, and the properties of the machine.
    for _ in range(3):
        TensorUnpickler(file, storage).load()
    tensors = TensorUnpickler(file, storage).load()
    for key in TensorUnpickler(file, storage).load():
        (count,) = struct.unpack("<q", file.read(8))
        if count != len(storages[key]):
            raise WrongFile(f"the storage {key} has {count} values, expected {len(storages[key])}")
        storages[key][:] = np.frombuffer(file.read(count * storages[key].itemsize), storages[key].dtype, count)
    return tensors


def read_tensors(path):
    """The tensors of a `.pth` file by name."""
    try:
        with open(path, "rb") as file:
            is_zip = zipfile.is_zipfile(file)
            file.seek(0)
            tensors = read_zip(file) if is_zip else read_legacy(file)
    except OSError as error:
        raise WrongFile(f"{path}: cannot be read: {error.strerror}") from error
    except WrongFile as error:
        raise WrongFile(f"{path}: {error}; give a file with a state dictionary of PyTorch") from error
    except Exception as error:
        raise WrongFile(f"{path}: is not a file of PyTorch, or is truncated ({error}); download it again") from error
    if not isinstance(tensors, dict):
        raise WrongFile(f"{path}: is not a state dictionary; give torchvision's or lpips's file")
    return tensors


def backbone_tensors(path):
    if path is not None:
        return path, read_tensors(path)
    try:
        import torchvision
    except ImportError as error:
        raise WrongFile(f"torchvision cannot be imported ({error}): pip install torchvision, or give --backbone") from error
    model = torchvision.models.alexnet(weights="IMAGENET1K_V1")
    return "torchvision's alexnet", {key: value.numpy() for key, value in model.state_dict().items()}


def linear_tensors(path):
    if path is None:
        # Found without importing the package, which would need torch.
        package = importlib.util.find_spec("lpips")
        if package is None or package.origin is None:
            raise WrongFile("the package lpips is not installed: pip install lpips, or give --linear")
        path = Path(package.origin).parent / "weights" / "v0.1" / "alex.pth"
    return path, read_tensors(path)


def tensor(source, tensors, name, shape=None):
    if name not in tensors:
        raise WrongFile(f"{source}: has no tensor {name}; is it another network's?")
    array = np.asarray(tensors[name], np.float32)
    if shape is not None and array.shape != shape:
        raise WrongFile(f"{source}: {name} is {array.shape}, expected {shape}; is it another network's?")
    if not np.isfinite(array).all():
        raise WrongFile(f"{source}: {name} has values that are not finite; download it again")
    return array


def write_safetensors(path, tensors, metadata):
    header, start = {"__metadata__": metadata}, 0
    for name, array in tensors.items():
        end = start + array.nbytes
        dtype = {"float32": "F32", "float16": "F16"}[array.dtype.name]
        header[name] = {"dtype": dtype, "shape": list(array.shape), "data_offsets": [start, end]}
        start = end
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    # Replaced at once: the file is never half-written.
    part = path.with_name(path.name + ".part")
    with open(part, "wb") as file:
        file.write(struct.pack("<Q", len(text)) + text)
        for array in tensors.values():
            file.write(np.ascontiguousarray(array, array.dtype.newbyteorder("<")).tobytes())
    os.replace(part, path)


def convert(backbone, linear, out, half):
    source, from_backbone = backbone_tensors(backbone)
    tensors = {}
    for name in CONVOLUTIONS:
        for part in ("weight", "bias"):
            key = f"features.{name}.{part}"
            tensors[key] = tensor(source, from_backbone, key)
            if half and part == "weight":
                tensors[key] = tensors[key].astype(np.float16)
    source, from_linear = linear_tensors(linear)
    for tap, channels in enumerate(CHANNELS):
        weights = tensor(source, from_linear, f"lin{tap}.model.1.weight", (1, channels, 1, 1))
        tensors[f"linear.{tap}"] = weights.reshape(channels)
    write_safetensors(out, tensors, {"lpips_backbone": "alex", "lpips_version": "0.1"})
    return sum(array.size for array in tensors.values())


def main():
    parser = argparse.ArgumentParser(description="Makes a file of LPIPS weights for ghand.")
    parser.add_argument("--out", type=Path, required=True, help="the safetensors file to write")
    parser.add_argument("--backbone", type=Path, help="torchvision's .pth file [default: torchvision downloads it]")
    parser.add_argument("--linear", type=Path, help="the lpips package's weights/v0.1/alex.pth [default: as installed]")
    parser.add_argument("--half", action="store_true", help="write the convolutions' weights as half floats")
    args = parser.parse_args()
    try:
        count = convert(args.backbone, args.linear, args.out, args.half)
    except (WrongFile, OSError) as error:
        sys.exit(f"error: {error}")
    print(f"{args.out}: {count} weights of AlexNet")


if __name__ == "__main__":
    main()
