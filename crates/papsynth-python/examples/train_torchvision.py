"""Trains LR-ASPP of torchvision on augmented fields: nuclei (1), objects that look like nuclei (2) and the rest (0).

Needs torch and torchvision. Fields are generated once, and augmented by torchvision.transforms.v2 each time they are
used. Training starts from random weights.
"""

from itertools import chain, islice, repeat

import numpy as np
import papsynth
import torch
from options import options
from torch.utils.data import DataLoader
from torchvision import tv_tensors
from torchvision.models.segmentation import lraspp_mobilenet_v3_large
from torchvision.transforms import v2

RECIPE = papsynth.recipe("lbc", widen=1.5)
CLASSES = ["nucleus", papsynth.MIMICS]
WEIGHTS = torch.tensor([0.2, 1.0, 1.0])
FIELDS = 500  # at most

AUGMENT = v2.Compose(
    [
        # The corners that rotation leaves empty are ignored.
        v2.RandomRotation(180, fill={tv_tensors.Image: 230, tv_tensors.Mask: papsynth.IGNORED}),
        v2.RandomHorizontalFlip(),
        v2.ColorJitter(brightness=0.1, contrast=0.2),
        v2.ToDtype({tv_tensors.Image: torch.float32, tv_tensors.Mask: torch.int64}, scale=True),
    ]
)


def sample(frame):
    """Return the image, 3 × height × width, uint8, and the class of each pixel."""
    return np.repeat(frame.image[None], 3, axis=0), papsynth.semantic_target(frame, CLASSES)


def augmented(batch):
    """Return augmented images, 0 to 1, and classes of a batch."""
    pairs = [AUGMENT(tv_tensors.Image(image), tv_tensors.Mask(target)) for image, target in batch]
    return torch.stack([image for image, _ in pairs]), torch.stack([target for _, target in pairs])


def main(arguments=None):
    given = options(__doc__, arguments, steps=4000, batch=8)
    torch.manual_seed(0)
    recipe = {**RECIPE, "field": {"width_px": given.size, "height_px": given.size, "pixel_um": 0.5}}
    count = min(given.steps * given.batch, FIELDS)
    fields = papsynth.Dataset(recipe, seed=1, length=count, transform=sample)
    fields = list(DataLoader(fields, batch_size=None, num_workers=given.workers))
    batches = DataLoader(fields, given.batch, shuffle=True, drop_last=count >= given.batch, collate_fn=augmented)
    device = "cuda" if torch.cuda.is_available() else "cpu"
    network = lraspp_mobilenet_v3_large(weights=None, weights_backbone=None, num_classes=1 + len(CLASSES)).to(device)
    error = torch.nn.CrossEntropyLoss(WEIGHTS.to(device), ignore_index=papsynth.IGNORED)
    optimizer = torch.optim.AdamW(network.parameters(), lr=1e-3)
    losses = []
    for images, targets in islice(chain.from_iterable(repeat(batches)), given.steps):
        loss = error(network(images.to(device))["out"], targets.to(device))
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(loss.item())
        if len(losses) % 20 == 0:
            print(f"step {len(losses)}: loss {np.mean(losses[-20:]):.3f}", flush=True)
    network.eval()
    right = []
    with torch.no_grad():
        for image, target in papsynth.Dataset(recipe, seed=2, length=8, transform=sample):
            image = torch.from_numpy(image[None].astype(np.float32) / 255).to(device)
            found = network(image)["out"].argmax(dim=1)[0].cpu().numpy()
            right.append((found == target)[target != papsynth.IGNORED])
    print(f"other fields: {np.concatenate(right).mean():.1%} of the pixels have the right class")
    if given.out:
        torch.save(network.state_dict(), given.out)
    return losses


if __name__ == "__main__":
    main()
