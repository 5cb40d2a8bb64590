//! The simulator of the 2015 paper.

use crate::debris::*;
use crate::recipe::camera::CameraPreset;
use crate::recipe::dyes::DyeAmounts;
use crate::recipe::imaging::{Background, Border, Illumination, Optics};
use crate::recipe::number::Number;
use crate::recipe::specimen::*;
use crate::recipe::whole::Recipe;

/// The values of the paper where it states them, else those of the authors' released code.
pub(super) fn recipe() -> Recipe {
    Recipe {
        slide: Slide {
            depth_um: 0.4.into(),
            relief_um: 60.0.into(),
            median_um: 8.0.into(),
            stacking_um: 0.0.into(),
            spacing_um: 0.0.into(),
            fields: 1,
        },
        layout: Layout::Clusters(Clusters { count: 3.0.into(), radius_um: 60.0.into(), outside: 0.1.into() }),
        cells: mix([("intermediate", 30.0.into())]),
        cytoplasm: Cytoplasm {
            shape: ShapeSpread::Independent,
            sheet: Sheet::Verlet,
            excess: 1.0.into(),
            folds: Folds { flap: 0.0.into(), roll: 0.0.into(), cigar: 0.0.into(), ..Folds::default() },
            corners: 0.0.into(),
            notches: 0.0.into(),
            tongues: 0.0.into(),
            wrinkles: 0.0.into(),
            wrinkle: 0.0.into(),
            wrinkle_um: 0.3.into(),
            endoplasm: 0.0.into(),
            clouds: 0.2.into(),
            clouds_um: 1.75.into(),
            flecks: 0.7.into(),
            flecks_threshold: 0.5.into(),
            cytoskeleton: 0.3.into(),
            grain: 0.0.into(),
            granular: 0.0.into(),
            granules: 0.0.into(),
            fray_um: 0.0.into(),
            rim_um: 0.0.into(),
            wedge: 0.0.into(),
            phase_rad: 0.0.into(),
        },
        nucleus: Nucleus {
            shape: ShapeSpread::Independent,
            chromatin: Chromatin::Quilt,
            acceptance: Acceptance::Threshold,
            d_max: 0.06.into(),
            seam: Seam::Feather,
            restore: Restore::AfterDetection,
            pyknotic: 0.0.into(),
            wrinkled: 0.0.into(),
            rim: 0.0.into(),
            dome: 0.0.into(),
            clumping: 0.0.into(),
            edge_um: 0.0.into(),
            wedge: 0.0.into(),
            ..Nucleus::default()
        },
        // The paper's stain is a grey value.
        stain: Stain {
            slide_cytoplasm: 1.0.into(),
            slide_nucleus: 1.0.into(),
            field_cytoplasm: 1.0.into(),
            field_nucleus: 1.0.into(),
            field_texture: 1.0.into(),
            slide_balance: 0.0.into(),
            field_balance: 0.0.into(),
            cell_balance: 0.0.into(),
            cyanophilic: DyeAmounts::grey(),
            eosinophilic: DyeAmounts::grey(),
            orangeophilic: DyeAmounts::grey(),
            nucleus: DyeAmounts::grey(),
            bacillus: DyeAmounts::grey(),
            speckle: DyeAmounts::grey(),
        },
        debris: debris(),
        background: Background {
            level: (235.0 / 255.0).into(),
            illumination: Illumination::Border(Border { exponent: 0.02.into() }),
            scatter: (10.0 / 255.0).into(),
            scatter_um: 55.0.into(),
        },
        // 70 photo-electrons a grey level of 8 bits; the released read noise is one grey level.
        camera: CameraPreset::Paper.camera(),
        optics: Optics::gaussian(),
        ..Recipe::default()
    }
}

/// The paper's four kinds of debris.
fn debris() -> Debris {
    let mut debris = Debris::none();
    debris.leukocytes = Leukocytes {
        clusters: 8.0.into(),
        per_cluster: Number::uniform(3.0, 6.0),
        cluster_um: Number::uniform(2.5, 6.0),
        on_cells: 0.5.into(),
        form: NucleusForm::Round,
        radius_um: Number::normal(2.6, 0.25),
        alpha: 0.10.into(),
        beta: 0.10.into(),
        absorbance: 0.70.into(),
        halo: 0.0.into(),
        ..Leukocytes::default()
    };
    debris.bacilli = Bacilli {
        clusters: 8.0.into(),
        per_cluster: Number::uniform(8.0, 20.0),
        cluster_um: Number::uniform(6.0, 22.0),
        on_cells: 0.75.into(),
        length_um: Number::log_normal(2.4, 0.35),
        width_um: Number::normal(0.55, 0.06),
        bend_deg: 0.0.into(),
        chained: 0.0.into(),
        absorbance: 0.15.into(),
        phase_rad: 0.0.into(),
    };
    debris.speckles = Speckles {
        count: 120.0.into(),
        form: SpeckForm::Dilated,
        dilations: Number::choice([0.0, 0.0, 1.0]),
        absorbance: 0.25.into(),
        phase_rad: 0.0.into(),
    };
    debris.out_of_focus = OutOfFocus {
        count: 5.0.into(),
        radius_um: Number::log_normal(9.0, 0.5),
        alpha: 0.15.into(),
        beta: 0.2.into(),
        depth_um: Number::uniform(14.0, 40.0),
        absorbance: 0.35.into(),
    };
    debris
}
