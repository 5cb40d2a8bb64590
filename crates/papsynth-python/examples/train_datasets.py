"""Trains a U-Net on a data set of the library Hugging Face `datasets`: fields on disk, split by slide.

Needs torch, datasets and pillow. Several processes generate the fields into the cache of `datasets`. Later runs with
the same recipe, model and version of papsynth read them from there.
"""

from itertools import chain, islice, repeat

import numpy as np
import papsynth
import torch
from datasets import Dataset, Features, Image, Value
from options import options
from torch.utils.data import DataLoader
from train_unet import CLASSES, RECIPE, WEIGHTS, UNet

FIELDS = 500  # at most
FEATURES = Features({"index": Value("int64"), "slide": Value("int64"), "image": Image(), "target": Image()})


def generate(recipe, identity, indices):
    """Yield fields as rows. The cache compares `identity`: engines with equal identity give equal fields."""
    for index in indices:
        frame = papsynth.render(recipe, seed=1, index=index)
        target = papsynth.semantic_target(frame, CLASSES)
        yield {"index": index, "slide": frame.slide, "image": frame.image, "target": target}


def data_set(recipe, count, workers):
    """Return a data set of fields with the image and the class of each pixel, both as PNG."""
    given = {"recipe": recipe, "identity": papsynth.Engine(recipe).identity, "indices": list(range(count))}
    return Dataset.from_generator(generate, FEATURES, gen_kwargs=given, num_proc=min(workers, count) or None)


def tensors(rows):
    """Return images, 1 × height × width, 0 to 1, and classes of rows."""
    images = [torch.from_numpy(np.asarray(image, dtype=np.float32)[None] / 255) for image in rows["image"]]
    return {"image": images, "target": [torch.from_numpy(np.asarray(one, dtype=np.int64)) for one in rows["target"]]}


def main(arguments=None):
    given = options(__doc__, arguments, steps=2000, batch=8)
    torch.manual_seed(0)
    field = {"width_px": given.size, "height_px": given.size, "pixel_um": 0.5}
    # Fields of a slide have the same stain and light, so a slide is either for training or for the score.
    recipe = {**RECIPE, "field": field, "slide": {**RECIPE["slide"], "fields_per_slide": 8}}
    fields = data_set(recipe, min(max(given.steps * given.batch, 16), FIELDS), given.workers)
    training, others = (
        fields.filter(lambda slide, is_other=is_other: (slide % 5 == 0) == is_other, input_columns="slide")
        for is_other in (False, True)
    )
    batches = DataLoader(training.with_transform(tensors), given.batch, shuffle=True)
    device = "cuda" if torch.cuda.is_available() else "cpu"
    network = UNet(classes=1 + len(CLASSES)).to(device)
    error = torch.nn.CrossEntropyLoss(WEIGHTS.to(device), ignore_index=papsynth.IGNORED)
    optimizer = torch.optim.AdamW(network.parameters(), lr=2e-3)
    losses = []
    for batch in islice(chain.from_iterable(repeat(batches)), given.steps):
        loss = error(network(batch["image"].to(device)), batch["target"].to(device))
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(loss.item())
        if len(losses) % 20 == 0:
            print(f"step {len(losses)}: loss {np.mean(losses[-20:]):.3f}", flush=True)
    network.eval()
    right = []
    with torch.no_grad():
        for row in others.with_transform(tensors):
            found = network(row["image"][None].to(device)).argmax(dim=1)[0].cpu()
            right.append((found == row["target"])[row["target"] != papsynth.IGNORED].numpy())
    print(f"other slides: {np.concatenate(right).mean():.1%} of the pixels have the right class")
    if given.out:
        torch.save(network.state_dict(), given.out)
    return losses


if __name__ == "__main__":
    main()
