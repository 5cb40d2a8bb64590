"""Trains Mask R-CNN of torchvision to find nuclei (1) and objects that look like nuclei (2), with masks.

Needs torch and torchvision. Training starts from random weights; with weights_backbone="DEFAULT", torchvision
downloads a backbone trained on ImageNet.
"""

import numpy as np
import papsynth
import torch
from options import options
from torch.utils.data import DataLoader
from torchvision.models.detection import maskrcnn_resnet50_fpn
from torchvision.models.detection.rpn import AnchorGenerator

RECIPE = papsynth.recipe("lbc", widen=1.5)
CLASSES = ["nucleus", papsynth.MIMICS]


def sample(frame):
    """Return the image, 3 × height × width, 0 to 1, and the target without ignored objects."""
    image = torch.from_numpy(frame.image.astype(np.float32) / (2**frame.bits - 1)).expand(3, -1, -1)
    target = papsynth.detection_target(frame, part=None, classes=CLASSES, by="semantic_class")
    seen = target["iscrowd"] == 0
    return image, {name: torch.from_numpy(target[name][seen]) for name in ("boxes", "labels", "masks")}


def network(size, classes):
    # Five levels of features, each with anchors of one size, pixels.
    anchors = AnchorGenerator(tuple((side,) for side in (8, 16, 32, 64, 128)), ((0.5, 1.0, 2.0),) * 5)
    return maskrcnn_resnet50_fpn(
        weights=None,
        weights_backbone=None,
        num_classes=classes,
        min_size=size,
        max_size=size,
        rpn_anchor_generator=anchors,
    )


def main(arguments=None):
    given = options(__doc__, arguments, steps=5000, batch=4)
    torch.manual_seed(0)
    recipe = {**RECIPE, "field": {"width_px": given.size, "height_px": given.size, "pixel_um": 0.5}}
    fields = papsynth.Dataset(recipe, seed=1, length=given.steps * given.batch, transform=sample)
    device = "cuda" if torch.cuda.is_available() else "cpu"
    detector = network(given.size, 1 + len(CLASSES)).to(device).train()
    optimizer = torch.optim.AdamW(detector.parameters(), lr=1e-4)
    losses = []
    # Fields have different numbers of objects, so a batch is a list.
    for batch in DataLoader(fields, given.batch, num_workers=given.workers, collate_fn=list):
        images = [image.to(device) for image, _ in batch]
        targets = [{name: values.to(device) for name, values in target.items()} for _, target in batch]
        loss = sum(detector(images, targets).values())
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(loss.item())
        if len(losses) % 5 == 0:
            print(f"step {len(losses)}: loss {np.mean(losses[-5:]):.3f}", flush=True)
    if given.out:
        torch.save(detector.state_dict(), given.out)
    return losses


if __name__ == "__main__":
    main()
