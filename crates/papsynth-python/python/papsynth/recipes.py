"""Recipes as objects: every field with its type and meaning, for editors that complete them.

>>> from papsynth.recipes import CellMix, Field, Recipe, uniform
>>> recipe = Recipe(field=Field(width_px=640, height_px=480), cells={"intermediate": CellMix(count=uniform(3, 6))})
>>> frame = papsynth.render(recipe)

What is left out is the default. Written by tools/write_recipes.py from the schema; not to be changed by hand.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Literal, Union

Number = Union[int, float, "dict[str, Any]"]
"""A number, or a distribution that it is drawn from."""


def _bounded(distribution: dict[str, Any], min: float | None, max: float | None) -> dict[str, Any]:
    bounds = {name: bound for name, bound in (("min", min), ("max", max)) if bound is not None}
    return {**distribution, **bounds}


def uniform(low: float, high: float, *, min: float | None = None, max: float | None = None) -> dict[str, Any]:
    """Any number between two, all equally likely."""
    return _bounded({"uniform": [low, high]}, min, max)


def normal(mean: float, sd: float, *, min: float | None = None, max: float | None = None) -> dict[str, Any]:
    """A normal number."""
    return _bounded({"normal": [mean, sd]}, min, max)


def log_normal(median: float, sd: float, *, min: float | None = None, max: float | None = None) -> dict[str, Any]:
    """A number whose logarithm is normal, of that standard deviation."""
    return _bounded({"log_normal": [median, sd]}, min, max)


def choice(*numbers: float, min: float | None = None, max: float | None = None) -> dict[str, Any]:
    """One of some numbers, all equally likely."""
    return _bounded({"choice": list(numbers)}, min, max)


def _plain(value: Any) -> Any:
    if isinstance(value, Section):
        return value.to_dict()
    if isinstance(value, dict):
        return {key: _plain(inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(inner) for inner in value]
    return value


class Section:
    """A section of a recipe."""

    __slots__ = ()

    def to_dict(self) -> dict[str, Any]:
        """As a dictionary, without what was left out."""
        values = ((field.name, getattr(self, field.name)) for field in fields(self))
        return {name: _plain(value) for name, value in values if value is not None}


@dataclass(kw_only=True, slots=True)
class Bacilli(Section):
    """Rod-shaped bacteria ("Bacilli"), such as lactobacilli."""

    absorbance: Number | None = None
    """Absorbance. From 0 to 4."""

    bend_deg: Number | None = None
    """Bend of a bacillus. From 0 to 120 degrees between its ends."""

    chained: Number | None = None
    """Share of the bacilli that hang together in chains of two to four. From 0 to 1."""

    cluster_um: Number | None = None
    """Radius (standard deviation) of a cluster. From 0 to 1000 µm."""

    clusters: Number | None = None
    """Number of clusters; drawn once a field. From 0 to 100000."""

    length_um: Number | None = None
    """Length of a bacillus. From 0.3 to 50 µm."""

    on_cells: Number | None = None
    """Share of the clusters that lie on a cell. From 0 to 1."""

    per_cluster: Number | None = None
    """Bacilli of a cluster. From 1 to 10000."""

    phase_rad: Number | None = None
    """How late light comes through a bacillus; seen by bright-field optics alone. From -3 to 3 radians of phase."""

    width_um: Number | None = None
    """Width of a bacillus. From 0.1 to 5 µm."""


@dataclass(kw_only=True, slots=True)
class Background(Section):
    """The empty slide, as the lamp shows it (Eqs. 8–10)."""

    illumination: Illumination | None = None
    """How evenly the lamp lights the field."""

    level: Number | None = None
    """Light of the empty slide as a fraction of the camera's largest grey level (b of Eq. 8). From 0.01 to 1.2."""

    scatter: Number | None = None
    """Strength of Perlin noise in the light, as a fraction of the largest grey level (c_pe of Eq. 9). From 0 to 0.5."""

    scatter_um: Number | None = None
    """Size of the cells of that noise. From 1 to 10000 µm."""


@dataclass(kw_only=True, slots=True)
class BareNuclei(Section):
    """Bare nuclei: what bacteria leave of intermediate cells."""

    absorbance: Number | None = None
    """Absorbance, before the field's stain of nuclei. From 0 to 4."""

    count: Number | None = None
    """Number of nuclei; drawn once a field. From 0 to 100000."""

    elongation: Number | None = None
    """Length relative to width. From 1 to 4."""

    on_cells: Number | None = None
    """Share of the nuclei that lie on a cell. From 0 to 1."""

    radius_um: Number | None = None
    """Radius of the disc of the same area. From 1 to 20 µm."""

    shreds: Number | None = None
    """Absorbance of the shreds of cytoplasm round it. From 0 to 4."""

    texture: Number | None = None
    """Contrast of its chromatin relative to the absorbance. From 0 to 2."""


@dataclass(kw_only=True, slots=True)
class Bubbles(Section):
    """Air bubbles in the mountant."""

    absorbance: Number | None = None
    """Absorbance of the rim: what it throws beside the objective. From 0 to 4."""

    count: Number | None = None
    """Number of bubbles; drawn once a field. From 0 to 10000."""

    height_um: Number | None = None
    """How far above the cells it lies. From -1000 to 1000 µm."""

    phase_rad: Number | None = None
    """How late light comes through the rim; seen by bright-field optics alone. From -3 to 3 radians of phase."""

    radius_um: Number | None = None
    """Radius. From 1 to 250 µm."""

    rim: Number | None = None
    """Width of the dark rim relative to the radius. From 0.01 to 1."""


@dataclass(kw_only=True, slots=True)
class Camera(Section):
    """The camera (Eq. 13, g_po and g_g): the linear model of EMVA 1288. Numbers are those of one pixel of the sensor."""

    binning: Binning | None = None
    """How they are joined."""

    binning_px: Number | None = None
    """Pixels of the sensor along the side of one of the picture. From 1 to 8."""

    bits: Number | None = None
    """Bits of a grey level. From 8 to 16."""

    blooming: Number | None = None
    """Share of the charge that a full pixel cannot hold and that blooms into its neighbours; the rest is drained. From 0 to 1."""

    blooming_vertical: Number | None = None
    """Share of that which stays within its column. From 0 to 1."""

    dark_current_e_per_s: Number | None = None
    """Dark current at `dark_reference_c`. From 0 to 1000000 electrons per second and pixel."""

    dark_doubling_c: Number | None = None
    """Warming that doubles the dark current. From 0.1 to 100 K."""

    dark_reference_c: Number | None = None
    """Temperature for which the dark current is given. From -200 to 150 °C."""

    dsnu_e: Number | None = None
    """Dark signal non-uniformity: spread of the pixels' offsets. From 0 to 100000 electrons."""

    exposure_s: Number | None = None
    """Exposure: how long dark current is gathered. Light is what `background.level` says. From 0 to 1000000 seconds."""

    full_well_e: Number | None = None
    """Electrons that a pixel holds, which the largest grey level stands for. From 10 to 10000000."""

    glare_removed: Number | None = None
    """Glare that was taken off the picture as its black level, as a share of the light of the empty slide: what is dark keeps the
    noise of the glare. From 0 to 0.8.
    """

    jpeg_quality: Number | None = None
    """Quality of a JPEG through which the picture has gone, or 0 for none; 8 bits only. From 0 to 100."""

    jpeg_subsampling: Subsampling | None = None
    """How much of the colour that leaves out."""

    offset_dn: Number | None = None
    """Grey level of a dark pixel. From 0 to 4096."""

    photon_noise: PhotonNoise | None = None
    """How photons are counted."""

    pixel_um: Number | None = None
    """Side of a pixel of the sensor; `field.magnification` makes it the picture's. From 1 to 100 µm."""

    prnu: Number | None = None
    """Photo response non-uniformity: spread of the pixels' responses as a share of their mean. From 0 to 0.5."""

    read_noise_e: Number | None = None
    """Standard deviation of the read noise; where pixels differ, its median. From 0 to 100000 electrons."""

    read_noise_rms_e: Number | None = None
    """Root of the mean square of the read noises of pixels that differ, as in CMOS: from `read_noise_e` to 20 times that. 0 where
    all pixels are alike. From 0 to 100000 electrons.
    """

    serial: int | None = None
    """Which camera of its kind it is: its fixed pattern is the same in all images. From 0 to 9007199254740992.0."""

    temperature_c: Number | None = None
    """Temperature of the sensor. From -200 to 150 °C."""


@dataclass(kw_only=True, slots=True)
class Candidas(Section):
    """*Candida*: colonies of pseudohyphae and budding yeasts."""

    absorbance: Number | None = None
    """Absorbance. From 0 to 4."""

    branches: Number | None = None
    """Probability of a branch at each septum. From 0 to 1."""

    buds: Number | None = None
    """Probability of buds at each septum. From 0 to 1."""

    colonies: Number | None = None
    """Number of colonies; drawn once a field. From 0 to 10000."""

    colony_um: Number | None = None
    """Radius (standard deviation) of a colony. From 0 to 1000 µm."""

    dyes: DyeAmounts | None = None
    """Its dyes."""

    hyphae: Number | None = None
    """Pseudohyphae of a colony. From 0 to 1000."""

    on_cells: Number | None = None
    """Share of the colonies that lie on a cell. From 0 to 1."""

    phase_rad: Number | None = None
    """How late light comes through; seen by bright-field optics alone. From -3 to 3 radians of phase."""

    segment_um: Number | None = None
    """Length of a segment. From 2 to 50 µm."""

    segments: Number | None = None
    """Segments of a pseudohypha. From 1 to 30."""

    width_um: Number | None = None
    """Width of a pseudohypha. From 0.5 to 10 µm."""

    yeast_um: Number | None = None
    """Diameter of a yeast. From 0.5 to 20 µm."""

    yeasts: Number | None = None
    """Yeasts of a colony, most of them budding. From 0 to 10000."""


@dataclass(kw_only=True, slots=True)
class CellMix(Section):
    """How many cells of a class there are, and how they differ from the model's."""

    count: Number | None = None
    """Number of cells of this class; drawn once a field. From 0 to 100000."""

    cytoplasm_stain: Number | None = None
    """Factor on the absorbance of its cytoplasm; drawn for each cell. From 0 to 20."""

    group: Group | None = None
    """How its cells lie together."""

    nucleus_stain: Number | None = None
    """Factor on the absorbance of its nucleus; drawn for each cell. From 0 to 20."""

    size: Number | None = None
    """Factor on the size of the whole cell; drawn for each cell. From 0.1 to 10."""

    tints: TintMix | None = None
    """How likely its cytoplasm is to take each tint."""


@dataclass(kw_only=True, slots=True)
class ClueCells(Section):
    """Clue cells: cells covered with coccobacilli, and cells with patches of them."""

    absorbance: Number | None = None
    """Absorbance. From 0 to 4."""

    beyond_um: Number | None = None
    """How far the coat reaches beyond the cell's rim. From 0 to 20 µm."""

    cover: Number | None = None
    """Share of the cell that the dense patches of its coat cover. From 0 to 1."""

    density: Number | None = None
    """Coccobacilli per µm² where a coat is dense. From 0 to 10."""

    share: Number | None = None
    """Share of the cells that carry a coat; drawn once a field. From 0 to 1."""

    width_um: Number | None = None
    """Width of a coccobacillus. From 0.1 to 5 µm."""


@dataclass(kw_only=True, slots=True)
class Cocci(Section):
    """Cocci and coccobacilli, colony by colony."""

    absorbance: Number | None = None
    """Absorbance. From 0 to 4."""

    chains: Number | None = None
    """Share of the colonies that are one chain. From 0 to 1."""

    cloud_um: Number | None = None
    """Radius (standard deviation) of a cloud. From 0 to 500 µm."""

    colonies: Number | None = None
    """Number of colonies; drawn once a field. From 0 to 100000."""

    diameter_um: Number | None = None
    """Diameter of a coccus. From 0.1 to 5 µm."""

    elongation: Number | None = None
    """Length of a coccus relative to its diameter: above 1.3 it is a coccobacillus. From 1 to 5."""

    on_cells: Number | None = None
    """Share of the colonies that lie on a cell. From 0 to 1."""

    per_colony: Number | None = None
    """Cocci of a colony. From 1 to 20000."""

    phase_rad: Number | None = None
    """How late light comes through a coccus; seen by bright-field optics alone. From -3 to 3 radians of phase."""


@dataclass(kw_only=True, slots=True)
class Crystals(Section):
    """Precipitated dye: dark, angular, refracting grains."""

    absorbance: Number | None = None
    """Absorbance. From 0 to 4."""

    count: Number | None = None
    """Number of grains; drawn once a field. From 0 to 100000."""

    diameter_um: Number | None = None
    """Diameter. From 0.2 to 50 µm."""

    dyes: DyeAmounts | None = None
    """Its dyes."""

    on_cells: Number | None = None
    """Share of the grains that lie on a cell. From 0 to 1."""

    phase_rad: Number | None = None
    """How late light comes through it; seen by bright-field optics alone. From -3 to 3 radians of phase."""


@dataclass(kw_only=True, slots=True)
class Cytoplasm(Section):
    """The cytoplasm of every cell."""

    clouds: Number | None = None
    """First level of detail: strength of low-frequency Gaussian noise, relative to the cytoplasm's absorbance. From 0 to 2."""

    clouds_um: Number | None = None
    """Standard deviation of its smoothing. From 0.1 to 100 µm."""

    corners: Number | None = None
    """How nearly straight the sides of a cell run between its corners: 0 is not at all. From 0 to 1."""

    cytoskeleton: Number | None = None
    """Third level of detail: strength of the cytoskeleton, relative to the cytoplasm's absorbance. From 0 to 2."""

    endoplasm: Number | None = None
    """How much denser and more granular the cytoplasm is round the nucleus than outside. From 0 to 2."""

    excess: Number | None = None
    """Area of the flat sheet relative to the cell's: more makes more wrinkles. From 1 to 2."""

    flecks: Number | None = None
    """Second level of detail: strength of thresholded Brownian flecks, relative to the cytoplasm's absorbance. From 0 to 5."""

    flecks_threshold: Number | None = None
    """Share of the cell that the flecks leave free. From 0 to 0.999."""

    folds: Folds | None = None
    """Parts that lie doubled back."""

    fray_um: Number | None = None
    """Roughness of the rim: the edge is frayed over about this distance. From 0 to 5 µm."""

    grain: Number | None = None
    """Fine grain of the cytoplasm, relative to its absorbance. From 0 to 2."""

    granular: Number | None = None
    """Probability that a cell is peppered with granules. From 0 to 1."""

    granules: Number | None = None
    """Granules of such a cell per 100 µm². From 0 to 1000."""

    notches: Number | None = None
    """Notches in its rim. From 0 to 20."""

    phase_rad: Number | None = None
    """How late light comes through a flat sheet: thicker parts and folds in proportion. It shows as bright and dark rims that change
    places when the focus passes. From -3 to 3 radians of phase.
    """

    rim_um: Number | None = None
    """Distance over which the sheet thins out towards its rim. From 0 to 10 µm."""

    shape: ShapeSpread | None = None
    """How outlines vary about their mean."""

    sheet: Sheet | None = None
    """How the cytoplasm becomes a sheet."""

    tongues: Number | None = None
    """Tongues that stand out of its rim. From 0 to 20."""

    wedge: Number | None = None
    """How much thicker the sheet is towards one side (standard deviation of the slope, relative to its thickness and the cell's
    radius). From 0 to 1.
    """

    wrinkle: Number | None = None
    """Thickness that a wrinkle adds at its crest, relative to the flat sheet. From 0 to 5."""

    wrinkle_um: Number | None = None
    """Width of a wrinkle (standard deviation of its crest). From 0.05 to 5 µm."""

    wrinkles: Number | None = None
    """Wrinkles of a cell: narrow creases in which the sheet lies doubled. From 0 to 100."""


@dataclass(kw_only=True, slots=True)
class Debris(Section):
    """Everything that is no epithelial cell."""

    bacilli: Bacilli | None = None
    """Rod-shaped bacteria, in clusters, on cells and between them."""

    bare_nuclei: BareNuclei | None = None
    """Bare nuclei."""

    bubbles: Bubbles | None = None
    """Air bubbles in the mountant."""

    candida: Candidas | None = None
    """*Candida*: pseudohyphae and budding yeasts."""

    clue_cells: ClueCells | None = None
    """Clue cells: epithelial cells covered with coccobacilli."""

    cocci: Cocci | None = None
    """Cocci and coccobacilli, colony by colony."""

    crystals: Crystals | None = None
    """Precipitated dye: dark, angular, refracting grains."""

    dirt: Dirt | None = None
    """Faint flecks of background dirt."""

    dust: Dust | None = None
    """Dust on the glass, out of focus."""

    fibres: Fibres | None = None
    """Fibres of cotton and cloth."""

    leukocytes: Leukocytes | None = None
    """White blood cells, single and in clusters."""

    mucus: Mucus | None = None
    """Strands of mucus."""

    out_of_focus: OutOfFocus | None = None
    """Objects far outside the depth of the slide."""

    red_cells: RedCells | None = None
    """Red blood cells and their ghosts."""

    scratches: Scratches | None = None
    """Scratches in the glass."""

    smudges: Smudges | None = None
    """Amorphous debris: granular clumps."""

    speckles: Speckles | None = None
    """Specks of dust and stain, anywhere."""

    trichomonads: Trichomonads | None = None
    """Trichomonads, pale pear-shaped flagellates."""


@dataclass(kw_only=True, slots=True)
class Deposit(Section):
    """The round deposit of a liquid-based preparation: by default a circle 13 mm wide, as filters and settling chambers leave it."""

    edge_um: Number | None = None
    """Distance over which it thins out at its edge. From 1 to 100000 µm."""

    outside: Number | None = None
    """Density beyond its edge, relative to that within. From 0 to 1."""

    patch_um: Number | None = None
    """Size of its dense and thin patches. From 50 to 100000 µm."""

    radius_um: Number | None = None
    """Its radius. From 1 to 1000000 µm."""

    unevenness: Number | None = None
    """How unevenly the cells lie: standard deviation of the logarithm of their density. From 0 to 1."""

    x_um: Number | None = None
    """Its middle, from the left border of the picture; drawn once a slide, as all that follow. From -1000000 to 1000000 µm."""

    y_um: Number | None = None
    """Its middle, from the upper border of the picture. From -1000000 to 1000000 µm."""


@dataclass(kw_only=True, slots=True)
class Dirt(Section):
    """Faint flecks of background dirt, in drifts that the fluid has laid down side by side. Each fleck lies at a depth of its own,
    but nobody counts them: the truth has one row and one mask for all of them.
    """

    absorbance: Number | None = None
    """Absorbance. From 0 to 4."""

    aligned: Number | None = None
    """Share of the flecks that lie in the direction of their drift. From 0 to 1."""

    drift_um: Number | None = None
    """Radius (standard deviation) of a drift. From 0 to 1000 µm."""

    drifts: Number | None = None
    """Number of drifts; drawn once a field. From 0 to 100000."""

    dyes: DyeAmounts | None = None
    """Their dyes."""

    length_um: Number | None = None
    """Length of a fleck. From 0.1 to 20 µm."""

    per_drift: Number | None = None
    """Flecks of a drift. From 1 to 10000."""

    phase_rad: Number | None = None
    """How late light comes through a fleck; seen by bright-field optics alone. From -3 to 3 radians of phase."""

    width_um: Number | None = None
    """Width of a fleck. From 0.1 to 10 µm."""


@dataclass(kw_only=True, slots=True)
class Dust(Section):
    """Dust on the cover glass or within the mountant."""

    absorbance: Number | None = None
    """Absorbance. From 0 to 4."""

    count: Number | None = None
    """Number of grains; drawn once a field. From 0 to 100000."""

    diameter_um: Number | None = None
    """Diameter. From 0.5 to 200 µm."""

    height_um: Number | None = None
    """How far above the cells it lies: 170 is the outside of a cover glass, less lies within the mountant. From -1000 to 1000 µm."""


@dataclass(kw_only=True, slots=True)
class DyeAmounts(Section):
    """Amounts of dyes in what is stained with strength 1, each as the absorbance at the dye's own peak. The strength of the stain is
    what the model and the factors of this section say: the absorbance at 0.57 µm where the amounts are such that their
    absorbances add up to 1 there.
    """

    eosin_y: float | None = None
    """Eosin Y, pink, peak near 0.53 µm. From 0 to 100."""

    haematein: float | None = None
    """Haematein bound to aluminium, blue-violet, peak near 0.58 µm. From 0 to 100."""

    light_green: float | None = None
    """Light green SF, blue-green, peak near 0.63 µm. From 0 to 100."""

    neutral: float | None = None
    """Something grey that absorbs all light alike. From 0 to 100."""

    orange_g: float | None = None
    """Orange G, orange, peak near 0.48 µm. From 0 to 100."""


@dataclass(kw_only=True, slots=True)
class Fibres(Section):
    """Fibres of cotton and cloth, in the mountant or on the glass."""

    absorbance: Number | None = None
    """Absorbance. From 0 to 4."""

    count: Number | None = None
    """Number of fibres; drawn once a field. From 0 to 10000."""

    height_um: Number | None = None
    """How far above the cells it lies: 170 is the outside of a cover glass, less lies within the mountant. From -1000 to 1000 µm."""

    length_um: Number | None = None
    """Length. From 5 to 500 µm."""

    phase_rad: Number | None = None
    """How late light comes through its middle; seen by bright-field optics alone. From -3 to 3 radians of phase."""

    waves: Number | None = None
    """How wavy it is: 0 is straight. From 0 to 2."""

    width_um: Number | None = None
    """Width. From 0.5 to 50 µm."""


@dataclass(kw_only=True, slots=True)
class Field(Section):
    """The image: its size and the size of its pixels. Counts of cells and debris are those of a whole field, whatever its size."""

    height_px: Number | None = None
    """Height; drawn once a field. From 16 to 32768 pixels."""

    magnification: Number | None = None
    """Magnification between slide and sensor, relay optics included, or 0 if `pixel_um` says it all. A pixel is then
    `camera.pixel_um` times `camera.binning_px`, divided by this: 6.45 µm at 40 · 0.645 are 0.25 µm. From 0 to 400.
    """

    pixel_um: Number | None = None
    """Size of a pixel in the object (the paper's: 0.25). Not looked at where `magnification` is given. From 0.05 to 4 µm."""

    width_px: Number | None = None
    """Width; drawn once a field. From 16 to 32768 pixels."""


@dataclass(kw_only=True, slots=True)
class Focus(Section):
    """Focal planes. A plane is where the stage stands; what is in focus there lies deeper or higher by the ratio of the two indices
    of refraction, if the optics know them.
    """

    centre_um: Number | None = None
    """Travel of the stage to the middle plane; at 0 the middle of the slide is in focus, at more what lies nearer to the objective.
    From -100 to 100 µm.
    """

    fused_noise_across: Number | None = None
    """How much of its noise a fused picture shares with the next pixel of the row. From 0 to 0.5."""

    fused_noise_down: Number | None = None
    """The same with the next pixel of the column. From 0 to 0.5."""

    fused_noise_skew: Number | None = None
    """How much more it shares with the next pixel down to the right than with that down to the left (half of the difference):
    pictures that were turned or shifted by parts of a pixel have some. From -0.1 to 0.1.
    """

    picture: Picture | None = None
    """What becomes of the planes."""

    planes: Number | None = None
    """Number of focal planes: 1 is an image, more are a focus stack. From 1 to 1024."""

    step_um: Number | None = None
    """Travel of the stage between planes. From 0.001 to 100 µm."""


@dataclass(kw_only=True, slots=True)
class Folds(Section):
    """Parts of a cell that lie doubled back on it."""

    cigar: Number | None = None
    """Probability that the cell is folded over completely, like a cigar. From 0 to 1."""

    depth: Number | None = None
    """How far in from the rim a flap begins, as a fraction of the cell's radius. From 0.02 to 0.9."""

    flap: Number | None = None
    """Probability that a flap of the cell lies folded back on it. From 0 to 1."""

    radius_um: Number | None = None
    """Radius of the bend. From 0.1 to 5 µm."""

    roll: Number | None = None
    """Probability that a rim is rolled up. From 0 to 1."""


@dataclass(kw_only=True, slots=True)
class Group(Section):
    """How cells of a class lie together."""

    distance: Number | None = None
    """Distance between the middles of neighbours, relative to their diameter: below 1 they overlap. From 0.2 to 3."""

    form: GroupForm | None = None
    """The form of a group."""

    size: Number | None = None
    """Cells of a group; drawn for each group. From 1 to 1000."""


@dataclass(kw_only=True, slots=True)
class IlluminationBorder(Section):
    """The paper's: distance to the image's border to the power of an exponent (Eq. 8)."""

    kind: Literal['border'] = 'border'

    exponent: Number | None = None
    """The exponent n: 0 is even; the released value is 0.02. From 0 to 2."""


@dataclass(kw_only=True, slots=True)
class IlluminationBowl(Section):
    """A smooth bowl, 1 − x2·x² − y2·y² over −1..1, as measured on real fields."""

    kind: Literal['bowl'] = 'bowl'

    off_centre: Number | None = None
    """Where the top of the bowl lies, as a fraction of half the field to either side. From 0 to 0.9."""

    x2: Number | None = None
    """Fall towards the left and right border, as a fraction of the centre. From 0 to 0.45."""

    y2: Number | None = None
    """Fall towards the upper and lower border, as a fraction of the centre. From 0 to 0.45."""


@dataclass(kw_only=True, slots=True)
class LayoutUniform(Section):
    """Anywhere, all places equally likely (Eq. 5)."""

    kind: Literal['uniform'] = 'uniform'


@dataclass(kw_only=True, slots=True)
class LayoutClusters(Section):
    """Round clusters at random places, and some cells outside them."""

    kind: Literal['clusters'] = 'clusters'

    count: Number | None = None
    """Number of clusters; drawn once a field. From 1 to 10000."""

    outside: Number | None = None
    """Weight of the places outside all clusters, relative to a cluster's centre. From 0 to 1."""

    radius_um: Number | None = None
    """Radius (standard deviation) of a cluster; drawn for each cluster. From 1 to 10000 µm."""


@dataclass(kw_only=True, slots=True)
class LayoutSwath(Section):
    """A band of material across the image."""

    kind: Literal['swath'] = 'swath'

    outside: Number | None = None
    """Weight of the places outside the band, relative to its middle. From 0 to 1."""

    width_um: Number | None = None
    """Width (standard deviation) of the band. From 1 to 10000 µm."""


@dataclass(kw_only=True, slots=True)
class LayoutMap(Section):
    """A grey image that is stretched over the field: white is likely, black never happens."""

    kind: Literal['map'] = 'map'

    path: str | None = None
    """File of the image, relative to the recipe."""


@dataclass(kw_only=True, slots=True)
class LayoutLabels(Section):
    """The layout of a given label image: as likely as the place is covered by a label there."""

    kind: Literal['labels'] = 'labels'

    path: str | None = None
    """File of the label image, relative to the recipe."""

    smooth_um: Number | None = None
    """Standard deviation of the smoothing of its coverage. From 0 to 1000 µm."""


@dataclass(kw_only=True, slots=True)
class Leukocytes(Section):
    """White blood cells ("White blood cells", Eqs. 6, 7, Fig. 9)."""

    absorbance: Number | None = None
    """Absorbance, before the field's stain of nuclei. From 0 to 4."""

    alpha: Number | None = None
    """Range of the radial perturbation (α of Eq. 7). From 0 to 0.5."""

    beta: Number | None = None
    """Range of the angular perturbation (β of Eq. 7). From 0 to 0.5 radians."""

    cell_um: Number | None = None
    """Diameter of a lobed leukocyte's cytoplasm. From 1 to 100 µm."""

    cluster_um: Number | None = None
    """Radius (standard deviation) of a cluster; of lobed ones that of those which do not touch another. From 0 to 1000 µm."""

    clusters: Number | None = None
    """Number of clusters; drawn once a field. From 0 to 100000."""

    degenerated: Number | None = None
    """Probability that a lobed leukocyte is degenerated: its nucleus smudged, its cytoplasm frayed. From 0 to 1."""

    form: NucleusForm | None = None
    """How the nucleus is shaped."""

    halo: Number | None = None
    """Absorbance of the pale cytoplasm round the nucleus. From 0 to 4."""

    lobes: Number | None = None
    """Lobes of a lobed nucleus. From 1 to 8."""

    on_cells: Number | None = None
    """Share of the clusters that lie on a cell. From 0 to 1."""

    per_cluster: Number | None = None
    """Leukocytes of a cluster. From 1 to 10000."""

    radius_um: Number | None = None
    """Radius of a leukocyte's nucleus (s of Eq. 7); of a lobed one that of the disc of its area. From 0.3 to 20 µm."""

    touching: Number | None = None
    """Share of a cluster's lobed leukocytes that touch another one. From 0 to 1."""


@dataclass(kw_only=True, slots=True)
class LightMonochrome(Section):
    """A grey image in the light of one interference filter."""

    kind: Literal['monochrome'] = 'monochrome'

    bandwidth_um: Number | None = None
    """Width of the filter's band. From 0 to 0.1 µm."""

    wavelength_um: Number | None = None
    """Wavelength (the paper's: 0.57, where nuclei stand out most). From 0.4 to 0.7 µm."""


@dataclass(kw_only=True, slots=True)
class LightColour(Section):
    """A colour image: halogen lamp, colour camera, white balance on the empty slide."""

    kind: Literal['colour'] = 'colour'

    chromatic_um: Number | None = None
    """How much farther from the objective red light (0.65 µm) comes to focus than green (0.55 µm); what an apochromat leaves is
    below one. From -10 to 10 µm of stage travel.
    """

    lamp_k: Number | None = None
    """Temperature of the lamp. From 2000 to 10000 K."""

    mixing: Mixing | None = None
    """How dyes make colours."""

    rendition: Rendition | None = None
    """How the camera's colours are written."""


@dataclass(kw_only=True, slots=True)
class Mucus(Section):
    """Strands of mucus, bundles of faint fibres."""

    absorbance: Number | None = None
    """Absorbance of a fibre. From 0 to 4."""

    dyes: DyeAmounts | None = None
    """Its dyes."""

    fibre_um: Number | None = None
    """Width of a fibre. From 0.1 to 5 µm."""

    fibres: Number | None = None
    """Fibres across a strand. From 1 to 200."""

    length_um: Number | None = None
    """Length of a strand. From 5 to 400 µm."""

    on_cells: Number | None = None
    """Share of the strands that lie on a cell. From 0 to 1."""

    phase_rad: Number | None = None
    """How late light comes through a fibre; seen by bright-field optics alone. From -3 to 3 radians of phase."""

    strands: Number | None = None
    """Number of strands; drawn once a field. From 0 to 10000."""

    width_um: Number | None = None
    """Width of a strand. From 1 to 100 µm."""


@dataclass(kw_only=True, slots=True)
class Nucleus(Section):
    """The nucleus of every cell."""

    acceptance: Acceptance | None = None
    """Which patches are candidates."""

    chromatin: Chromatin | None = None
    """Where the texture comes from."""

    clumping: Number | None = None
    """Part of the variance of chromatin that is coarse, a micrometre and a half wide: what lies above and below the grains in focus.
    From 0 to 1.
    """

    d_max: Number | None = None
    """d_max of the paper: root-mean-square difference of absorbance over the overlap. From 0 to 10."""

    dome: Number | None = None
    """Share of a nucleus's thickness that is domed: 0 is a plate, 1 an ellipsoid. From 0 to 1."""

    donors: Number | None = None
    """Donors of one nucleus (the paper's: 3). From 1 to 64."""

    edge_um: Number | None = None
    """How softly a nucleus ends: standard deviation of the fall of its thickness about its outline. From 0 to 3 µm."""

    overlap_um: Number | None = None
    """Overlap of patches (the released value: 2 px of 0.25 µm). From 0.25 to 10 µm."""

    patch_um: Number | None = None
    """Size of a patch (the released value: 7 px of 0.25 µm). From 0.5 to 20 µm."""

    pyknotic: Number | None = None
    """Probability that a nucleus is pyknotic (small, dark, without structure). From 0 to 1."""

    restore: Restore | None = None
    """What happens to nuclei whose donors were images already."""

    restore_feather_um: Number | None = None
    """Spread of the feathered mask of that. From 0 to 5 µm."""

    rim: Number | None = None
    """Absorbance of the rim (the nuclear membrane) relative to the nucleus. From 0 to 2."""

    seam: Seam | None = None
    """How patches are joined."""

    shape: ShapeSpread | None = None
    """How outlines vary about their mean."""

    wedge: Number | None = None
    """How much thicker a nucleus is towards one side (standard deviation of the slope, relative to its thickness and radius). From 0
    to 1.
    """

    wrinkled: Number | None = None
    """Probability that a nucleus is wrinkled or angular. From 0 to 1."""


@dataclass(kw_only=True, slots=True)
class OpticsBrightField(Section):
    """Partially coherent bright field: what every slab transmits, filtered by the weak-object transfer function."""

    kind: Literal['bright-field'] = 'bright-field'

    astigmatism: Number | None = None
    """Astigmatism between rows and columns (root mean square). From -1 to 1 waves."""

    coma: Number | None = None
    """Coma along the rows (root mean square). From -1 to 1 waves."""

    condenser_na: Number | None = None
    """Numerical aperture to which the condenser is opened, below `mount_index`; what exceeds `na` is lost light. 0.41 gives 0.25 µm
    of blur for each µm of stage travel, the paper's Fig. 10. From 0.05 to 1.6.
    """

    cover_error_um: Number | None = None
    """How much thicker the cover glass is than the lens was made for. From -50 to 50 µm."""

    directions: Number | None = None
    """Directions of light that `abbe` follows. From 1 to 65536."""

    extra_blur_um: Number | None = None
    """Standard deviation of further spread: relay optics, charge diffusion, vibration. 0.16 makes edges as wide as the paper
    measured them, 0.9 px. From 0 to 10 µm.
    """

    imaging: Imaging | None = None
    """How light is followed through the slide."""

    immersion_index: Number | None = None
    """Refractive index between cover glass and objective: 1 for a dry lens. From 1 to 2."""

    mount_index: Number | None = None
    """Refractive index of the mountant in which the cells lie. From 1 to 2."""

    na: Number | None = None
    """Numerical aperture of the objective, at most `immersion_index` and below `mount_index`. From 0.05 to 1.6."""

    oversampling: Number | None = None
    """Samples of the slide along the side of a pixel. From 1 to 4."""

    slab_um: Number | None = None
    """Thickness of the slabs between which `abbe` carries light; `product` knows every depth. From 0.1 to 10 µm."""

    spherical: Number | None = None
    """Spherical aberration of the objective (root mean square). From -1 to 1 waves."""

    stray_light: Number | None = None
    """Share of an empty field's light that lies evenly over the picture: glare. From 0 to 0.5."""


@dataclass(kw_only=True, slots=True)
class OpticsGaussian(Section):
    """The paper's: Gaussians on the absorbance (Eqs. 13, 14, Fig. 10)."""

    kind: Literal['gaussian'] = 'gaussian'

    sigma_xy_um: Number | None = None
    """Standard deviation of the spread in the image plane (the paper's: 0.9 px of 0.25 µm). From 0 to 20 µm."""

    sigma_z_um_per_um: Number | None = None
    """Growth of the spread with distance from focus. The paper's calibration is 0.25, that is one pixel of 0.25 µm per µm; its
    sentence read as "µm per µm" would be 1. From 0 to 10 µm per µm.
    """


@dataclass(kw_only=True, slots=True)
class OutOfFocus(Section):
    """Objects far outside the depth of the slide ("Out of focus objects")."""

    absorbance: Number | None = None
    """Absorbance. From 0 to 4."""

    alpha: Number | None = None
    """Range of the radial perturbation (α of Eq. 7). From 0 to 0.5."""

    beta: Number | None = None
    """Range of the angular perturbation (β of Eq. 7). From 0 to 0.5 radians."""

    count: Number | None = None
    """Number of objects; drawn once a field. From 0 to 100000."""

    depth_um: Number | None = None
    """Distance from the middle of the slide, above or below it. From 0 to 1000 µm."""

    radius_um: Number | None = None
    """Radius (s of Eq. 7). From 0.3 to 500 µm."""


@dataclass(kw_only=True, slots=True)
class RedCells(Section):
    """Red blood cells, in clusters."""

    absorbance: Number | None = None
    """Absorbance: haemoglobin in a disc of 2 µm absorbs 0.1 at 0.57 µm. From 0 to 4."""

    cluster_um: Number | None = None
    """Radius (standard deviation) of a cluster. From 0 to 1000 µm."""

    clusters: Number | None = None
    """Number of clusters; drawn once a field. From 0 to 100000."""

    diameter_um: Number | None = None
    """Diameter. From 1 to 30 µm."""

    dyes: DyeAmounts | None = None
    """Its dyes: haemoglobin and eosin are much alike."""

    ghosts: Number | None = None
    """Probability that it is a ghost that has lost its haemoglobin. From 0 to 1."""

    on_cells: Number | None = None
    """Share of the clusters that lie on a cell. From 0 to 1."""

    pallor: Number | None = None
    """Absorbance of the middle relative to the rim. From 0 to 1."""

    per_cluster: Number | None = None
    """Red cells of a cluster. From 1 to 10000."""

    phase_rad: Number | None = None
    """How late light comes through it; seen by bright-field optics alone. From -3 to 3 radians of phase."""


@dataclass(kw_only=True, slots=True)
class Scan(Section):
    """A whole slide, as a scanner sees it frame by frame (`papsynth slide`); fields do not look at it. Counts of cells and debris
    are those of a field, whose size then says how dense they lie where the deposit is full.
    """

    deposit: Deposit | None = None
    """Where the material lies."""

    frame_px: int | None = None
    """Side of the square frames that the scanner's camera takes: each is lit and exposed by itself. From 128 to 8192 pixels."""

    height_px: int | None = None
    """Its height. From 64 to 1000000 pixels."""

    reach_um: float | None = None
    """Farthest that an object's picture may reach from the object's middle; what would reach further is refused. From 10 to 2000 µm."""

    shading_left: float | None = None
    """Share of the unevenness of the lamp (`background.illumination`) that the scanner's correction leaves. From 0 to 1."""

    width_px: int | None = None
    """Width of the slide's picture. From 64 to 1000000 pixels."""


@dataclass(kw_only=True, slots=True)
class Scratches(Section):
    """Scratches in the slide or in the cover glass."""

    absorbance: Number | None = None
    """Absorbance. From 0 to 4."""

    count: Number | None = None
    """Number of scratches; drawn once a field. From 0 to 10000."""

    height_um: Number | None = None
    """How far above the cells it lies: a little below 0 is the slide's inner face, 170 the outside of a cover glass, where only wide
    ones are seen. From -1000 to 1000 µm.
    """

    length_um: Number | None = None
    """Length. From 5 to 500 µm."""

    phase_rad: Number | None = None
    """How late light comes through it; seen by bright-field optics alone. From -3 to 3 radians of phase."""

    width_um: Number | None = None
    """Width. From 0.1 to 20 µm."""


@dataclass(kw_only=True, slots=True)
class Slide(Section):
    """How deep the cells lie ("Final Image Formation": depth from a median-filtered Perlin image)."""

    depth_um: Number | None = None
    """Depth over which the cells of a field lie. From 0 to 1000 µm."""

    fields: int | None = None
    """Fields that are taken of one slide: images 0 to n − 1 show the first, the next n the second. Fields of one slide were stained
    together. From 1 to 1000000.
    """

    median_um: Number | None = None
    """Width of the median filter on that noise. From 0 to 1000 µm."""

    relief_um: Number | None = None
    """Size of the cells of the Perlin noise that says how depth varies over the field. From 1 to 10000 µm."""

    spacing_um: Number | None = None
    """Least distance between the middles of two cells; drawn once a field. From 0 to 1000 µm."""

    stacking_um: Number | None = None
    """Standard deviation of a cell's own depth about the relief: cells that lie on each other. From 0 to 100 µm."""


@dataclass(kw_only=True, slots=True)
class Smudges(Section):
    """Amorphous debris: granular clumps of what was left of cells, mucus and bacteria."""

    absorbance: Number | None = None
    """Absorbance. From 0 to 4."""

    count: Number | None = None
    """Number of clumps; drawn once a field. From 0 to 100000."""

    diameter_um: Number | None = None
    """Diameter of a clump. From 1 to 200 µm."""

    dyes: DyeAmounts | None = None
    """Its dyes."""

    elongation: Number | None = None
    """Length of a clump relative to its width. From 1 to 10."""

    grain_um: Number | None = None
    """Size of its grains. From 0.2 to 5 µm."""

    granularity: Number | None = None
    """How much the grains differ from each other, relative to the absorbance. From 0 to 2."""

    on_cells: Number | None = None
    """Share of the clumps that lie on a cell. From 0 to 1."""

    phase_rad: Number | None = None
    """How late light comes through it; seen by bright-field optics alone. From -3 to 3 radians of phase."""

    ragged: Number | None = None
    """How ragged its outline is: 0 is an ellipse. From 0 to 2."""


@dataclass(kw_only=True, slots=True)
class Speckles(Section):
    """Specks of dust and stain ("Speckles")."""

    absorbance: Number | None = None
    """Absorbance. From 0 to 4."""

    count: Number | None = None
    """Number of speckles; drawn once a field. From 0 to 1000000."""

    dilations: Number | None = None
    """How often a speckle is grown by a pixel to all sides (binary dilation). From 0 to 50."""

    form: SpeckForm | None = None
    """How it is grown from its two pixels."""

    phase_rad: Number | None = None
    """How late light comes through a speck: the halo that changes sign with focus. Seen by bright-field optics alone. From -3 to 3
    radians of phase.
    """


@dataclass(kw_only=True, slots=True)
class Stain(Section):
    """How evenly the stain was taken up."""

    bacillus: DyeAmounts | None = None
    """Dyes of bacteria."""

    cell_balance: Number | None = None
    """The same between the cells of a field. From 0 to 2."""

    cyanophilic: DyeAmounts | None = None
    """Dyes of cyanophilic cytoplasm."""

    eosinophilic: DyeAmounts | None = None
    """Dyes of eosinophilic cytoplasm."""

    field_balance: Number | None = None
    """The same between the fields of a slide. From 0 to 2."""

    field_cytoplasm: Number | None = None
    """Factor on the absorbance of all cytoplasm of a field; drawn once a field. From 0 to 20."""

    field_nucleus: Number | None = None
    """Factor on the absorbance of all nuclei of a field; drawn once a field. From 0 to 20."""

    field_texture: Number | None = None
    """Factor on the contrast of the texture inside all nuclei of a field; drawn once a field. From 0 to 20."""

    nucleus: DyeAmounts | None = None
    """Dyes of nuclei, also of leukocytes."""

    orangeophilic: DyeAmounts | None = None
    """Dyes of orangeophilic, keratinised cytoplasm."""

    slide_balance: Number | None = None
    """Balance of the dyes: standard deviation of the logarithm of each dye's amount between slides. From 0 to 2."""

    slide_cytoplasm: Number | None = None
    """Factor on the absorbance of all cytoplasm of a slide; drawn once a slide. From 0 to 20."""

    slide_nucleus: Number | None = None
    """Factor on the absorbance of all nuclei of a slide; drawn once a slide. From 0 to 20."""

    speckle: DyeAmounts | None = None
    """Dyes of specks."""


@dataclass(kw_only=True, slots=True)
class TintMix(Section):
    """How likely each tint of cytoplasm is, relative to the others."""

    cyanophilic: Number | None = None
    """Blue-green, as in young and intermediate cells. From 0 to 1000."""

    eosinophilic: Number | None = None
    """Pink, as in superficial cells. From 0 to 1000."""

    orangeophilic: Number | None = None
    """Orange, as in keratinised cells. From 0 to 1000."""


@dataclass(kw_only=True, slots=True)
class Trichomonads(Section):
    """Trichomonads, pale pear-shaped flagellates."""

    absorbance: Number | None = None
    """Absorbance of the pale body. From 0 to 4."""

    dyes: DyeAmounts | None = None
    """Its dyes; the nucleus takes those of other nuclei."""

    group_um: Number | None = None
    """Radius (standard deviation) of a group. From 0 to 1000 µm."""

    groups: Number | None = None
    """Number of groups; drawn once a field. From 0 to 100000."""

    length_um: Number | None = None
    """Length. From 2 to 60 µm."""

    nucleus: Number | None = None
    """Absorbance of the nucleus above the body. From 0 to 4."""

    on_cells: Number | None = None
    """Share of the groups that lie on a cell. From 0 to 1."""

    per_group: Number | None = None
    """Trichomonads of a group. From 1 to 10000."""

    width: Number | None = None
    """Width relative to the length. From 0.2 to 1."""


@dataclass(kw_only=True, slots=True)
class Recipe(Section):
    """A recipe: everything that decides an image except the model, the seed and the index."""

    background: Background | None = None
    """The empty slide, as the lamp shows it."""

    camera: Camera | None = None
    """The camera."""

    cells: dict[str, CellMix] | None = None
    """The cells, by the name of their class in the model."""

    cytoplasm: Cytoplasm | None = None
    """The cytoplasm of every cell."""

    debris: Debris | None = None
    """Everything that is no epithelial cell."""

    field: Field | None = None
    """The image: its size and the size of its pixels."""

    focus: Focus | None = None
    """Focal planes: one for an image, several for a focus stack."""

    layout: Layout | None = None
    """Where the cells lie."""

    light: Light | None = None
    """The light: one wavelength or three colours."""

    nucleus: Nucleus | None = None
    """The nucleus of every cell."""

    optics: Optics | None = None
    """How light spreads between slide and sensor."""

    scan: Scan | None = None
    """A whole slide."""

    slide: Slide | None = None
    """The slide: how deep the cells lie."""

    stain: Stain | None = None
    """How evenly the stain was taken up."""

    version: int | None = None
    """Version of this file's format."""


Acceptance = Union[Literal['near'], Literal['threshold']]
"""Which patches of the donors are candidates ("Texture synthesis")."""


Binning = Union[Literal['charge'], Literal['digital']]
"""How the sensor's pixels are joined to the picture's."""


Chromatin = Union[Literal['quilt'], Literal['field']]
"""Where the texture of nuclei comes from."""


GroupForm = Union[Literal['alone'], Literal['heap'], Literal['honeycomb'], Literal['palisade']]
"""The form of a group of cells."""


Illumination = Union[IlluminationBorder, IlluminationBowl]
"""How evenly the lamp lights the field."""


Imaging = Union[Literal['product'], Literal['abbe']]
"""How light is followed through the slide."""


Layout = Union[LayoutUniform, LayoutClusters, LayoutSwath, LayoutMap, LayoutLabels]
"""Where the cells lie: the weight map of "Population Distribution Generation"."""


Light = Union[LightMonochrome, LightColour]
"""The light: one wavelength or three colours."""


Mixing = Union[Literal['spectral'], Literal['three-vectors'], Literal['per-wavelength']]
"""How dyes make colours."""


NucleusForm = Union[Literal['lobed'], Literal['round']]
"""How the nucleus of a leukocyte is shaped."""


Optics = Union[OpticsBrightField, OpticsGaussian]
"""How light spreads between slide and sensor."""


PhotonNoise = Union[Literal['exact'], Literal['normal'], Literal['off']]
"""How photons are counted."""


Picture = Union[Literal['planes'], Literal['extended']]
"""What becomes of the planes of a focus stack."""


Rendition = Union[Literal['raw'], Literal['display'], Literal['srgb']]
"""How the camera's colours are written."""


Restore = Union[Literal['before-detection'], Literal['after-detection'], Literal['off']]
"""What happens to nuclei whose donors were images already (Eqs. 15, 16)."""


Seam = Union[Literal['min-cut'], Literal['feather']]
"""How patches are joined."""


ShapeSpread = Union[Literal['correlated'], Literal['independent']]
"""How shapes vary about their mean."""


Sheet = Union[Literal['xpbd'], Literal['verlet'], Literal['flat']]
"""How the cytoplasm becomes a sheet."""


SpeckForm = Union[Literal['round'], Literal['dilated']]
"""How a speck is grown from its two pixels."""


Subsampling = Union[Literal['full'], Literal['columns'], Literal['squares']]
"""How much of the colour JPEG leaves out."""

__all__ = [
    "Acceptance",
    "Bacilli",
    "Background",
    "BareNuclei",
    "Binning",
    "Bubbles",
    "Camera",
    "Candidas",
    "CellMix",
    "Chromatin",
    "ClueCells",
    "Cocci",
    "Crystals",
    "Cytoplasm",
    "Debris",
    "Deposit",
    "Dirt",
    "Dust",
    "DyeAmounts",
    "Fibres",
    "Field",
    "Focus",
    "Folds",
    "Group",
    "GroupForm",
    "Illumination",
    "IlluminationBorder",
    "IlluminationBowl",
    "Imaging",
    "Layout",
    "LayoutClusters",
    "LayoutLabels",
    "LayoutMap",
    "LayoutSwath",
    "LayoutUniform",
    "Leukocytes",
    "Light",
    "LightColour",
    "LightMonochrome",
    "Mixing",
    "Mucus",
    "Nucleus",
    "NucleusForm",
    "Number",
    "Optics",
    "OpticsBrightField",
    "OpticsGaussian",
    "OutOfFocus",
    "PhotonNoise",
    "Picture",
    "Recipe",
    "RedCells",
    "Rendition",
    "Restore",
    "Scan",
    "Scratches",
    "Seam",
    "Section",
    "ShapeSpread",
    "Sheet",
    "Slide",
    "Smudges",
    "SpeckForm",
    "Speckles",
    "Stain",
    "Subsampling",
    "TintMix",
    "Trichomonads",
    "choice",
    "log_normal",
    "normal",
    "uniform",
]
