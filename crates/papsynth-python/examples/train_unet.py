"""Trains a U-Net in PyTorch to separate nuclei (1), objects that look like nuclei (2) and everything else (0).

Needs torch.
"""

from functools import partial

import numpy as np
import papsynth
import torch
from options import options
from torch import nn
from torch.utils.data import DataLoader

RECIPE = papsynth.recipe("lbc", widen=1.5)
CLASSES = ["nucleus", papsynth.MIMICS]
WEIGHTS = torch.tensor([0.2, 1.0, 1.0])


def sample(frame):
    """Return the image, 1 × height × width, 0 to 1, and the class of each pixel."""
    image = frame.image[None].astype(np.float32) / (2**frame.bits - 1)
    return image, papsynth.semantic_target(frame, CLASSES).astype(np.int64)


def block(inputs, outputs):
    layers = []
    for channels in (inputs, outputs):
        layers += [nn.Conv2d(channels, outputs, 3, padding=1, bias=False), nn.BatchNorm2d(outputs), nn.ReLU()]
    return nn.Sequential(*layers)


class UNet(nn.Module):
    def __init__(self, classes, channels=(16, 32, 64, 128)):
        super().__init__()
        levels = list(zip(channels, channels[1:]))
        self.first, self.last = block(1, channels[0]), nn.Conv2d(channels[0], classes, 1)
        self.down = nn.ModuleList(block(fine, coarse) for fine, coarse in levels)
        self.up = nn.ModuleList(nn.ConvTranspose2d(coarse, fine, 2, 2) for fine, coarse in levels)
        self.join = nn.ModuleList(block(2 * fine, fine) for fine, _ in levels)

    def forward(self, images):
        layers = [self.first(images)]
        for down in self.down:
            layers.append(down(nn.functional.max_pool2d(layers[-1], 2)))
        features = layers.pop()
        for up, join in zip(reversed(self.up), reversed(self.join)):
            features = join(torch.cat([layers.pop(), up(features)], dim=1))
        return self.last(features)


def main(arguments=None):
    given = options(__doc__, arguments, steps=2000, batch=8)
    torch.manual_seed(0)
    recipe = {**RECIPE, "field": {"width_px": given.size, "height_px": given.size, "pixel_um": 0.5}}
    fields = partial(papsynth.Dataset, recipe, transform=sample)
    device = "cuda" if torch.cuda.is_available() else "cpu"
    network = UNet(classes=1 + len(CLASSES)).to(device)
    error = nn.CrossEntropyLoss(WEIGHTS.to(device), ignore_index=papsynth.IGNORED)
    optimizer = torch.optim.AdamW(network.parameters(), lr=2e-3)
    losses = []
    training = DataLoader(fields(seed=1, length=given.steps * given.batch), given.batch, num_workers=given.workers)
    for step, (images, targets) in enumerate(training, 1):
        loss = error(network(images.to(device)), targets.to(device))
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(loss.item())
        if step % 20 == 0:
            print(f"step {step}: loss {np.mean(losses[-20:]):.3f}", flush=True)
    network.eval()
    shared, union = np.zeros(len(CLASSES)), np.zeros(len(CLASSES))
    for images, targets in DataLoader(fields(seed=2, length=32), given.batch, num_workers=given.workers):
        with torch.no_grad():
            found = network(images.to(device)).argmax(dim=1).cpu()
        for label in range(len(CLASSES)):
            is_found, is_true = found == label + 1, targets == label + 1
            is_found &= targets != papsynth.IGNORED
            shared[label] += (is_found & is_true).sum()
            union[label] += (is_found | is_true).sum()
    nuclei, mimics = shared / np.maximum(union, 1)
    print(f"other fields: intersection over union {nuclei:.2f} for nuclei, {mimics:.2f} for mimics")
    if given.out:
        torch.save(network.state_dict(), given.out)
    return losses


if __name__ == "__main__":
    main()
