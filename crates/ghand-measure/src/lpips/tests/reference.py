"""Distances and gradients of LPIPS in JAX, in float64, for the tests: `python reference.py` writes reference.safetensors.

Needs jax and numpy. The weights are those of `Weights::random`, the pictures those of `pictures` in tests.rs.
"""

import json
import struct
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

jax.config.update("jax_enable_x64", True)

SHIFT = np.array([-0.030, -0.088, -0.188])
SCALE = np.array([0.458, 0.448, 0.450])
# Width and height: even and odd sides, and the smallest that AlexNet can process.
SIZES = [(31, 31), (40, 35)]


def random_unit(tensor, count):
    with np.errstate(over="ignore"):
        h = np.arange(count, dtype=np.uint32) * np.uint32(0x9E3779B1) ^ np.uint32(tensor * 0x7FEB352D & 0xFFFFFFFF)
        h = (h ^ (h >> np.uint32(16))) * np.uint32(0x85EBCA6B)
        h = (h ^ (h >> np.uint32(13))) * np.uint32(0xC2B2AE35)
        return (h ^ (h >> np.uint32(16))) / 2.0**32


class Random:
    """Hands out tensors in the order in which the file's documentation names them."""

    def __init__(self):
        self.tensor = 0

    def uniform(self, shape, least, most):
        self.tensor += 1
        values = least + (most - least) * random_unit(self.tensor, int(np.prod(shape)))
        return jnp.array(values.astype(np.float32).astype(np.float64).reshape(shape))

    def conv(self, inputs, outputs, kernel):
        most = (6.0 / (inputs * kernel * kernel)) ** 0.5
        weight = self.uniform((outputs, inputs, kernel, kernel), -most, most)
        return weight, self.uniform((outputs,), -0.1, 0.1)


def conv(x, parameters, stride=1, padding=0):
    weight, bias = parameters
    y = lax.conv_general_dilated(x, weight, (stride, stride), [(padding, padding)] * 2)
    return jax.nn.relu(y + bias[None, :, None, None])


def max_pool(x):
    return lax.reduce_window(x, -jnp.inf, lax.max, (1, 1, 3, 3), (1, 1, 2, 2), "VALID")


def alex(random):
    shapes = [(3, 64, 11), (64, 192, 5), (192, 384, 3), (384, 256, 3), (256, 256, 3)]
    layers = [random.conv(*shape) for shape in shapes]

    def features(x):
        first = conv(x, layers[0], 4, 2)
        second = conv(max_pool(first), layers[1], 1, 2)
        third = conv(max_pool(second), layers[2], 1, 1)
        fourth = conv(third, layers[3], 1, 1)
        return [first, second, third, fourth, conv(fourth, layers[4], 1, 1)]

    return features


CHANNELS = [64, 192, 384, 256, 256]


def picture(size, seed):
    """Display values `[height][width][3]` by formula."""
    width, height = size
    y, x, c = np.mgrid[:height, :width, :3]
    values = (x * x * 3 + y * y * 5 + c * 40 + x * y * (seed + 1) + seed * 17) % 256 / 255.0
    return values.astype(np.float32).astype(np.float64)


def unit(x):
    # Where all channels are zero, the derivative of the root is infinite: PyTorch's result is NaN there.
    squares = jnp.sum(x**2, axis=1, keepdims=True)
    length = jnp.where(squares > 0, jnp.sqrt(jnp.where(squares > 0, squares, 1.0)), 0.0)
    return x / (length + 1e-10)


def main():
    tensors = {}
    random = Random()
    features = alex(random)
    linear = [random.uniform((channels,), 0.0, 1.0) for channels in CHANNELS]

    def network_input(image):
        return (((2 * image - 1) - SHIFT) / SCALE).transpose(2, 0, 1)[None]

    def distance(image, truth):
        taps = zip(features(network_input(image)), features(network_input(truth)), linear)
        return sum(jnp.mean(jnp.sum(w[None, :, None, None] * (unit(a) - unit(b)) ** 2, axis=1)) for a, b, w in taps)

    for size in SIZES:
        value, gradient = jax.value_and_grad(distance)(picture(size, 0), picture(size, 1))
        key = f"alex.{size[0]}x{size[1]}"
        print(key, float(value), float(jnp.abs(gradient).max()))
        tensors[f"{key}.distance"] = np.array([value], np.float32)
        tensors[f"{key}.gradient"] = np.array(gradient, np.float32)
    header, data = {}, b""
    for key, array in tensors.items():
        start, data = len(data), data + array.tobytes()
        header[key] = {"dtype": "F32", "shape": list(array.shape), "data_offsets": [start, len(data)]}
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    Path(__file__).with_name("reference.safetensors").write_bytes(struct.pack("<Q", len(text)) + text + data)


main()
