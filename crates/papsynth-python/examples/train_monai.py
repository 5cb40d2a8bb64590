"""Trains the U-Net of MONAI to separate nuclei (1), objects that look like nuclei (2) and everything else (0).

Needs torch and monai.
"""

import numpy as np
import papsynth
import torch
from monai.inferers import sliding_window_inference
from monai.losses import MaskedDiceLoss
from monai.networks.nets import UNet
from options import options
from torch.utils.data import DataLoader

RECIPE = papsynth.recipe("lbc", widen=1.5)
CLASSES = ["nucleus", papsynth.MIMICS]


def sample(frame):
    """Return the image, 1 × height × width, 0 to 1, the class of each pixel, and where the class counts."""
    image = frame.image[None].astype(np.float32) / (2**frame.bits - 1)
    target = papsynth.semantic_target(frame, CLASSES)[None]
    counts = target != papsynth.IGNORED
    return image, (target * counts).astype(np.int64), counts.astype(np.float32)


def main(arguments=None):
    given = options(__doc__, arguments, steps=2000, batch=8)
    torch.manual_seed(0)
    recipe = {**RECIPE, "field": {"width_px": given.size, "height_px": given.size, "pixel_um": 0.5}}
    fields = papsynth.Dataset(recipe, seed=1, length=given.steps * given.batch, transform=sample)
    device = "cuda" if torch.cuda.is_available() else "cpu"
    network = UNet(2, 1, 1 + len(CLASSES), channels=(16, 32, 64, 128), strides=(2, 2, 2), num_res_units=2).to(device)
    dice = MaskedDiceLoss(to_onehot_y=True, softmax=True, batch=True)
    optimizer = torch.optim.AdamW(network.parameters(), lr=1e-3)
    losses = []
    for images, targets, counts in DataLoader(fields, given.batch, num_workers=given.workers):
        loss = dice(network(images.to(device)), targets.to(device), counts.to(device))
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(loss.item())
        if len(losses) % 20 == 0:
            print(f"step {len(losses)}: loss {np.mean(losses[-20:]):.3f}", flush=True)
    # A field of the usual size, in overlapping windows.
    recipe["field"] = {"pixel_um": 0.5}
    image, target, counts = papsynth.Dataset(recipe, seed=2, transform=sample)[0]
    network.eval()
    with torch.no_grad():
        image = torch.from_numpy(image[None]).to(device)
        found = sliding_window_inference(image, (given.size, given.size), given.batch, network).argmax(dim=1).cpu()
    right = (found.numpy() == target)[counts > 0]
    print(f"another field: {right.mean():.1%} of the pixels have the right class")
    if given.out:
        torch.save(network.state_dict(), given.out)
    return losses


if __name__ == "__main__":
    main()
