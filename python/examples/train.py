"""Trains a small network on a dataset of quadruped3d: python train.py out/latest"""

import sys

import torch
from torch.utils.data import DataLoader

from quadruped3d import Dataset, Shuffle

dataset = Dataset(sys.argv[1], augment=True)
sampler = Shuffle(dataset)
network = torch.nn.Sequential(torch.nn.Conv2d(3, 16, 8, 8), torch.nn.ReLU(), torch.nn.AdaptiveAvgPool2d(8),
                              torch.nn.Flatten(), torch.nn.Linear(1024, 26 * 2), torch.nn.Unflatten(1, (26, 2)))
optimiser = torch.optim.AdamW(network.parameters(), 1e-3)
for epoch in range(2):
    sampler.set_epoch(epoch)
    for batch in DataLoader(dataset, batch_size=8, sampler=sampler, num_workers=2):
        points, weight = batch["keypoints_2d"].split([2, 1], dim=2)
        loss = (weight * (network(batch["image"]) - points).abs()).sum() / weight.sum().clamp(min=1)
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
    print(f"epoch {epoch}: L1 error of the 2D keypoints {loss.item():.4f} crop sides")
