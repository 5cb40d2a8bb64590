"""Trains the Basic U-Net of MONAI on crops: nuclei (1), objects that look like nuclei (2) and everything else (0).

Needs torch and monai. Dictionary transforms of MONAI take four crops from each field, mostly around nuclei and mimics,
and rotate them; a field is generated once. Its metrics score another field.
"""

import numpy as np
import papsynth
import torch
from monai.data import DataLoader, Dataset
from monai.inferers import sliding_window_inference
from monai.metrics import DiceMetric
from monai.networks.nets import BasicUNet
from monai.networks.utils import one_hot
from monai.transforms import Compose, RandAdjustContrastd, RandCropByLabelClassesd, RandFlipd, RandRotate90d
from monai.utils import set_determinism
from options import options

RECIPE = papsynth.recipe("lbc", widen=1.5)
CLASSES = ["nucleus", papsynth.MIMICS]
COUNT = 1 + len(CLASSES)
KEYS = ("image", "target")


def sample(frame):
    """Return the image, 1 × height × width, 0 to 1, and the class of each pixel, 1 × height × width."""
    image = frame.image[None].astype(np.float32) / (2**frame.bits - 1)
    return {"image": image, "target": papsynth.semantic_target(frame, CLASSES)[None].astype(np.int64)}


def crops(side):
    """Return a transform of a field into four crops with this side, pixels."""
    # Weights of the classes at the centre of a crop. A class that a field does not have is left out.
    ratios = [1, 2, 2]
    return Compose(
        [
            RandCropByLabelClassesd(KEYS, "target", (side, side), ratios, num_classes=COUNT, num_samples=4, warn=False),
            RandRotate90d(KEYS, prob=0.75),
            RandFlipd(KEYS, prob=0.5, spatial_axis=0),
            RandAdjustContrastd("image", prob=0.5, gamma=(0.8, 1.25)),
        ]
    )


def main(arguments=None):
    given = options(__doc__, arguments, steps=2000, batch=4)
    set_determinism(0)
    recipe = {**RECIPE, "field": {"width_px": given.size, "height_px": given.size, "pixel_um": 0.5}}
    fields = papsynth.Dataset(recipe, seed=1, length=given.steps * given.batch, transform=sample)
    side = given.size // 2
    device = "cuda" if torch.cuda.is_available() else "cpu"
    network = BasicUNet(2, 1, COUNT, features=(16, 16, 32, 64, 128, 16)).to(device)
    error = torch.nn.CrossEntropyLoss(ignore_index=papsynth.IGNORED)
    optimizer = torch.optim.AdamW(network.parameters(), lr=1e-3)
    losses = []
    fields = Dataset(fields, crops(side))
    for batch in DataLoader(fields, batch_size=given.batch, num_workers=given.workers):
        loss = error(network(batch["image"].to(device)), batch["target"][:, 0].to(device))
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(loss.item())
        if len(losses) % 20 == 0:
            print(f"step {len(losses)}: loss {np.mean(losses[-20:]):.3f}", flush=True)
    # A field of the usual size, in overlapping windows.
    recipe["field"] = {"pixel_um": 0.5}
    image, target = papsynth.Dataset(recipe, seed=2, transform=sample)[0].values()
    network.eval()
    with torch.no_grad():
        image = torch.from_numpy(image[None]).to(device)
        found = sliding_window_inference(image, (side, side), given.batch, network).argmax(dim=1, keepdim=True).cpu()
    target = torch.from_numpy(target[None])
    counts = target != papsynth.IGNORED
    dice = DiceMetric(include_background=False, reduction="mean_batch")
    dice(one_hot(found * counts, COUNT), one_hot(target * counts, COUNT))
    nuclei, mimics = dice.aggregate().tolist()
    print(f"another field: Dice coefficient {nuclei:.2f} of nuclei, {mimics:.2f} of objects that look like them")
    if given.out:
        torch.save(network.state_dict(), given.out)
    return losses


if __name__ == "__main__":
    main()
