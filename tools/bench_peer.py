#!/usr/bin/env python3
"""The baseline of the benchmarks: the network's way through PyTorch as the released demo takes it, with random weights.

    .venv/bin/python tools/bench_peer.py [--dtype bfloat16] [--threads 1] [--batches 1 4 8] [--rounds 3] [--json FILE]

It is our own plain statement, in torch.nn, of what the released demo does with the released sizes (ViT-H, BioCLIP's
ViT-B/16, six decoder layers, a SMAL body of 3,889 vertices): predict runs the three parts once. Adaptation is one
picture at a time: each iteration runs the whole network again, with autograd on the two keypoint embeddings and the
three regression heads, and takes a step of Adam. The last iterate needs one more forward pass.

With bfloat16, the matrices are held in bfloat16 and everything runs under autocast. That is faster than autocast alone,
which casts all weights at every pass.

Prints wall and CPU seconds a picture: the medians of the rounds, whose settings take turns.
"""

from __future__ import annotations

import argparse
import json
import os
import pathlib
import statistics
import sys
import time
from collections.abc import Callable

import torch
from torch import nn
from torch.nn import functional

KEYPOINTS, JOINTS, BETAS, VERTICES = 26, 35, 41, 3889
WIDTH, FOCAL_PX, SIDE_PX = 1280, 1000.0, 256


class VitBlock(nn.Module):
    def __init__(self, width: int, heads: int) -> None:
        super().__init__()
        self.heads = heads
        self.norm1, self.norm2 = nn.LayerNorm(width, eps=1e-6), nn.LayerNorm(width, eps=1e-6)
        self.qkv, self.proj = nn.Linear(width, 3 * width), nn.Linear(width, width)
        self.fc1, self.fc2 = nn.Linear(width, 4 * width), nn.Linear(4 * width, width)

    def attend(self, x: torch.Tensor) -> torch.Tensor:
        batch, tokens, width = x.shape
        q, k, v = self.qkv(x).reshape(batch, tokens, 3, self.heads, width // self.heads).permute(2, 0, 3, 1, 4)
        weights = ((q * (width // self.heads) ** -0.5) @ k.transpose(-2, -1)).softmax(-1)
        return self.proj((weights @ v).transpose(1, 2).reshape(batch, tokens, width))

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        x = x + self.attend(self.norm1(x))
        return x + self.fc2(functional.gelu(self.fc1(self.norm2(x))))


class Vit(nn.Module):
    """Patches of 16 px, a class token, pre-norm blocks."""

    def __init__(self, width: int, depth: int, heads: int, padding_px: int, tokens: int) -> None:
        super().__init__()
        self.patches = nn.Conv2d(3, width, 16, 16, padding_px)
        self.cls = nn.Parameter(torch.zeros(1, 1, width))
        self.place = nn.Parameter(torch.randn(1, tokens + 1, width) * 0.02)
        self.blocks = nn.ModuleList(VitBlock(width, heads) for _ in range(depth))
        self.norm = nn.LayerNorm(width, eps=1e-6)

    def forward(self, images: torch.Tensor) -> torch.Tensor:
        x = self.patches(images).flatten(2).transpose(1, 2)
        x = torch.cat([self.cls.expand(len(x), -1, -1), x], 1) + self.place
        for block in self.blocks:
            x = block(x)
        return self.norm(x)


class DecoderLayer(nn.Module):
    def __init__(self) -> None:
        super().__init__()
        self.own = nn.MultiheadAttention(WIDTH, 8, batch_first=True)
        self.cross = nn.MultiheadAttention(WIDTH, 8, batch_first=True)
        self.fc1, self.fc2 = nn.Linear(WIDTH, 5120), nn.Linear(5120, WIDTH)
        self.norms = nn.ModuleList(nn.LayerNorm(WIDTH) for _ in range(3))

    def forward(self, x: torch.Tensor, image: torch.Tensor) -> torch.Tensor:
        x = self.norms[0](x + self.own(x, x, x)[0])
        x = self.norms[1](x + self.cross(x, image, image)[0])
        return self.norms[2](x + self.fc2(functional.gelu(self.fc1(x))))


def perceptron(into: int, hidden: int, out: int) -> nn.Sequential:
    return nn.Sequential(nn.Linear(into, hidden), nn.ReLU(), nn.Linear(hidden, out))


class Decoder(nn.Module):
    def __init__(self) -> None:
        super().__init__()
        self.register_buffer("place", torch.randn(192, WIDTH) * 0.02)
        self.init_pose = nn.Parameter(torch.tensor([1.0, 0, 0, 0, 1, 0]).repeat(1, JOINTS))
        self.init_camera = nn.Parameter(torch.tensor([[0.9, 0, 0]]))
        self.init_betas = perceptron(WIDTH, 256, BETAS)
        self.token = nn.Sequential(nn.Linear(6 * JOINTS + BETAS + 3, WIDTH), nn.LayerNorm(WIDTH), nn.ReLU())
        self.embeddings_2d = nn.Parameter(torch.randn(KEYPOINTS, WIDTH) * 0.02)
        self.embeddings_3d = nn.Parameter(torch.randn(KEYPOINTS, WIDTH) * 0.02)
        self.encode_2d, self.encode_3d = perceptron(2, 256, WIDTH), perceptron(3, 256, WIDTH)
        self.features = nn.Linear(WIDTH, WIDTH)
        self.read_2d, self.read_3d = perceptron(WIDTH, WIDTH, 2), perceptron(WIDTH, WIDTH, 3)
        self.layers = nn.ModuleList(DecoderLayer() for _ in range(6))
        self.norm = nn.LayerNorm(WIDTH)
        self.pose = perceptron(WIDTH, WIDTH, 6 * JOINTS)
        self.shape = perceptron(WIDTH, WIDTH, BETAS)
        self.camera = perceptron(WIDTH, WIDTH // 2, 3)

    def adapted(self) -> list[nn.Parameter]:
        heads = [*self.pose.parameters(), *self.shape.parameters(), *self.camera.parameters()]
        return [self.embeddings_2d, self.embeddings_3d, *heads]

    def update(self, x: torch.Tensor, grid: torch.Tensor) -> torch.Tensor:
        points_2d = self.read_2d(x[:, 1:1 + KEYPOINTS]).tanh() * 0.5
        found = functional.grid_sample(grid, 2 * points_2d.unsqueeze(2).to(grid.dtype), align_corners=False)
        added_2d = self.features(found.squeeze(3).transpose(1, 2)) + self.encode_2d(points_2d)
        points_3d = self.read_3d(x[:, 1 + KEYPOINTS:])
        added_3d = self.encode_3d(points_3d - points_3d[:, :2].mean(1, keepdim=True))
        return torch.cat([x[:, :1], x[:, 1:] + torch.cat([added_2d, added_3d], 1)], 1)

    def forward(self, image: torch.Tensor, bio: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        batch = len(image)
        image = image + self.place
        grid = image.reshape(batch, 12, 16, WIDTH).permute(0, 3, 1, 2)
        pose, camera = self.init_pose.expand(batch, -1), self.init_camera.expand(batch, -1)
        betas = self.init_betas(bio)
        token = self.token(torch.cat([pose, betas, camera], 1)).unsqueeze(1)
        x = torch.cat([token, self.embeddings_2d.expand(batch, -1, -1), self.embeddings_3d.expand(batch, -1, -1)], 1)
        for number, layer in enumerate(self.layers):
            x = layer(x, image)
            if number + 1 < len(self.layers):
                x = self.update(x, grid)
        read = self.norm(x)[:, 0]
        return pose + self.pose(read), betas + self.shape(read), camera + self.camera(read)


class Body(nn.Module):
    """Linear blend skinning of SMAL's sizes; its keypoints are means of vertices."""

    def __init__(self) -> None:
        super().__init__()
        self.register_buffer("template", torch.randn(VERTICES, 3))
        self.register_buffer("shapes", torch.randn(VERTICES * 3, BETAS) * 0.01)
        self.register_buffer("poses", torch.randn(9 * (JOINTS - 1), VERTICES * 3) * 0.001)
        self.register_buffer("joints", torch.rand(JOINTS, VERTICES) / VERTICES)
        self.register_buffer("skin", torch.rand(VERTICES, JOINTS).softmax(1))
        self.register_buffer("points", torch.randint(0, VERTICES, (KEYPOINTS, 4)))

    def forward(self, pose_6d: torch.Tensor, betas: torch.Tensor) -> torch.Tensor:
        batch = len(betas)
        first, second = pose_6d.reshape(batch, JOINTS, 2, 3).unbind(2)
        x = functional.normalize(first, dim=-1)
        y = functional.normalize(second - (x * second).sum(-1, keepdim=True) * x, dim=-1)
        turn = torch.stack([x, y, torch.cross(x, y, dim=-1)], -1)
        shaped = self.template + (betas @ self.shapes.T).reshape(batch, VERTICES, 3)
        rest = self.joints @ shaped
        change = (turn[:, 1:] - torch.eye(3)).reshape(batch, -1) @ self.poses
        posed = shaped + change.reshape(batch, VERTICES, 3)
        turns, places = [turn[:, 0]], [rest[:, 0]]
        for joint in range(1, JOINTS):
            parent = joint - 1
            turns.append(turns[parent] @ turn[:, joint])
            step = (turns[parent] @ (rest[:, joint] - rest[:, parent]).unsqueeze(-1)).squeeze(-1)
            places.append(places[parent] + step)
        turned, place = torch.stack(turns, 1), torch.stack(places, 1)
        offset = place - (turned @ rest.unsqueeze(-1)).squeeze(-1)
        each = torch.einsum("vj,bjkl->bvkl", self.skin, turned)
        vertices = (each @ posed.unsqueeze(-1)).squeeze(-1) + self.skin @ offset
        return vertices[:, self.points].mean(2)


class Network(nn.Module):
    def __init__(self) -> None:
        super().__init__()
        self.backbone = Vit(WIDTH, 32, 16, 2, 192)
        self.bioclip = Vit(768, 12, 12, 0, 196)
        self.bio = nn.Sequential(nn.Linear(768, 512, bias=False), nn.Linear(512, WIDTH), nn.LayerNorm(WIDTH))
        self.decoder, self.body = Decoder(), Body()

    def forward(self, images: torch.Tensor) -> torch.Tensor:
        """images (B, 3, 256, 256) -> the projected keypoints (B, 26, 2) in crop units."""
        tokens = self.backbone(images[:, :, :, 32:-32])[:, 1:]
        small = functional.interpolate(images, (224, 224), mode="bilinear", align_corners=False)
        with torch.no_grad():
            feature = self.bioclip(small)[:, 0]
        pose, betas, camera = self.decoder(tokens, self.bio(feature))
        with torch.autocast("cpu", enabled=False):
            points = self.body(pose.float(), betas.float())
            scale, x, y = camera.float().unbind(1)
            place = torch.stack([x, y, 2 * FOCAL_PX / (SIDE_PX * scale + 1e-9)], 1).unsqueeze(1)
            points = points + place
            return FOCAL_PX / SIDE_PX * points[..., :2] / points[..., 2:]


def fill_cheaply(tensor: torch.Tensor, *_: object, **__: object) -> torch.Tensor:
    """One random row for all rows: drawing 900 million numbers takes longer than a picture, and no time depends on them."""
    with torch.no_grad():
        return tensor.copy_(torch.randn(tensor.shape[-1]) * 0.02)


def make_network(dtype: torch.dtype) -> Network:
    torch.manual_seed(1)
    nn.init.kaiming_uniform_ = nn.init.xavier_uniform_ = fill_cheaply
    network = Network().eval().requires_grad_(False)
    adapted = {id(parameter) for parameter in network.decoder.adapted()}
    for parameter in network.parameters():
        if parameter.dim() > 1 and id(parameter) not in adapted:
            parameter.data = parameter.data.to(dtype)
    return network


def predict(network: Network, images: torch.Tensor, dtype: torch.dtype) -> None:
    with torch.no_grad(), torch.autocast("cpu", torch.bfloat16, enabled=dtype == torch.bfloat16):
        network(images)


def adapt(network: Network, image: torch.Tensor, dtype: torch.dtype, iterations: int) -> None:
    target = torch.rand(1, KEYPOINTS, 2) - 0.5
    adapted = network.decoder.adapted()
    kept = [parameter.detach().clone() for parameter in adapted]
    for parameter in adapted:
        parameter.requires_grad_(True)
    optimiser = torch.optim.Adam(adapted, lr=1e-6)
    for _ in range(iterations):
        with torch.autocast("cpu", torch.bfloat16, enabled=dtype == torch.bfloat16):
            loss = (network(image) - target).square().sum() / KEYPOINTS
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
    for parameter, value in zip(adapted, kept, strict=True):
        parameter.requires_grad_(False)
        parameter.data.copy_(value)
    predict(network, image, dtype)


def timed(work: Callable[[], None]) -> tuple[float, float]:
    wall, cpu = time.perf_counter(), time.process_time()
    work()
    return time.perf_counter() - wall, time.process_time() - cpu


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dtype", choices=["float32", "bfloat16"], default="float32")
    parser.add_argument("--threads", type=int, default=os.cpu_count())
    parser.add_argument("--batches", type=int, nargs="*", default=[1, 4, 8], help="of predict")
    parser.add_argument("--iterations", type=int, default=10, help="of adaptation; 0 leaves it out")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--json", type=pathlib.Path, help="a file for the numbers")
    options = parser.parse_args()
    torch.set_num_threads(options.threads)
    dtype = torch.bfloat16 if options.dtype == "bfloat16" else torch.float32
    network = make_network(dtype)
    images = torch.randn(max([1, *options.batches]), 3, SIDE_PX, SIDE_PX)
    predict(network, images[:1], dtype)  # the first pass makes the kernels
    found: dict[str, list[tuple[float, float]]] = {}
    for _ in range(options.rounds):
        for batch in options.batches:
            wall, cpu = timed(lambda batch=batch: predict(network, images[:batch], dtype))
            found.setdefault(f"predict, batch {batch}", []).append((wall / batch, cpu / batch))
        if options.iterations > 0:
            work = timed(lambda: adapt(network, images[:1], dtype, options.iterations))
            found.setdefault(f"adapt, {options.iterations} iterations", []).append(work)
    rows = {name: {"wall_s": statistics.median(w for w, _ in times), "cpu_s": statistics.median(c for _, c in times)}
            for name, times in found.items()}
    for name, row in rows.items():
        print(f"{options.dtype}, {options.threads} threads, {name}: {row['wall_s']:.3f} s a picture, "
              f"{row['cpu_s']:.3f} s of CPU")
    if options.json:
        options.json.write_text(json.dumps({"dtype": options.dtype, "threads": options.threads, "rows": rows}, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
