"""Trains SegFormer of Hugging Face to separate nuclei (1), objects that look like nuclei (2) and everything else (0).

Needs torch, transformers and accelerate. Training starts from random weights. To fine-tune the weights of ImageNet,
use from_pretrained("nvidia/mit-b0", ...), which downloads them; they need images of three channels.
"""

import tempfile

import numpy as np
import papsynth
from options import options
from transformers import SegformerConfig, SegformerForSemanticSegmentation, Trainer, TrainingArguments

RECIPE = papsynth.recipe("lbc", widen=1.5)
CLASSES = ["nucleus", papsynth.MIMICS]
NAMES = {0: "background", 1: "nucleus", 2: "mimic"}


def sample(frame):
    """Return the image, 1 × height × width, -1 to 1, and the class of each pixel."""
    image = frame.image[None].astype(np.float32) / (2**frame.bits - 1) * 2 - 1
    return {"pixel_values": image, "labels": papsynth.semantic_target(frame, CLASSES).astype(np.int64)}


def main(arguments=None):
    given = options(__doc__, arguments, steps=4000, batch=8)
    recipe = {**RECIPE, "field": {"width_px": given.size, "height_px": given.size, "pixel_um": 0.5}}
    fields = papsynth.Dataset(recipe, seed=1, length=given.steps * given.batch, transform=sample)
    others = papsynth.Dataset(recipe, seed=2, length=16, transform=sample)
    config = SegformerConfig(num_channels=1, id2label=NAMES, semantic_loss_ignore_index=papsynth.IGNORED)
    with tempfile.TemporaryDirectory() as scratch:
        training = TrainingArguments(
            output_dir=given.out or scratch,
            max_steps=given.steps,
            per_device_train_batch_size=given.batch,
            per_device_eval_batch_size=given.batch,
            dataloader_num_workers=given.workers,
            learning_rate=5e-4,
            lr_scheduler_type="cosine",
            logging_steps=min(max(given.steps // 10, 1), 50),
            prediction_loss_only=True,
            save_strategy="no",
            report_to="none",
        )
        trainer = Trainer(SegformerForSemanticSegmentation(config), training, train_dataset=fields, eval_dataset=others)
        trainer.train()
        print(f"other fields: loss {trainer.evaluate()['eval_loss']:.3f}")
        if given.out:
            trainer.save_model()
    return [entry["loss"] for entry in trainer.state.log_history if "loss" in entry]


if __name__ == "__main__":
    main()
