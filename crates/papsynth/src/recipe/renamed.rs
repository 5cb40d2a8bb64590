//! Former names of keys and values of recipes, for messages about recipes of earlier development versions.

/// Former key path, present key path. A class of cells is written as `*`.
const KEYS: &[(&str, &str)] = &[
    ("background.scatter", "background.texture"),
    ("background.scatter_um", "background.texture_um"),
    ("background.illumination.x2", "background.illumination.falloff_x"),
    ("background.illumination.y2", "background.illumination.falloff_y"),
    ("background.illumination.off_centre", "background.illumination.centre_offset"),
    ("camera.glare_removed", "camera.glare_subtracted"),
    ("cytoplasm.corners", "cytoplasm.angularity"),
    ("cytoplasm.excess", "cytoplasm.excess_area"),
    ("cytoplasm.grain", "cytoplasm.texture"),
    ("cytoplasm.folds.cigar", "cytoplasm.folds.folded_over"),
    ("cytoplasm.tongues", "cytoplasm.protrusions"),
    ("cytoplasm.wedge", "cytoplasm.thickness_gradient"),
    ("cytoplasm.wrinkle", "cytoplasm.wrinkle_thickness"),
    ("debris.bacilli.cluster_um", "debris.bacilli.cluster_radius_um"),
    ("debris.candida.colony_um", "debris.candida.colony_radius_um"),
    ("debris.candida.segment_um", "debris.candida.segment_length_um"),
    ("debris.candida.yeast_um", "debris.candida.yeast_diameter_um"),
    ("debris.clue_cells.beyond_um", "debris.clue_cells.overhang_um"),
    ("debris.clue_cells.cover", "debris.clue_cells.coverage"),
    ("debris.clue_cells.share", "debris.clue_cells.fraction"),
    ("debris.cocci.cloud_um", "debris.cocci.colony_radius_um"),
    ("debris.dirt.drift_um", "debris.dirt.cluster_radius_um"),
    ("debris.dirt.drifts", "debris.dirt.clusters"),
    ("debris.dirt.per_drift", "debris.dirt.per_cluster"),
    ("debris.leukocytes.cell_um", "debris.leukocytes.cytoplasm_diameter_um"),
    ("debris.leukocytes.cluster_um", "debris.leukocytes.cluster_radius_um"),
    ("debris.leukocytes.halo", "debris.leukocytes.cytoplasm_absorbance"),
    ("debris.mucus.fibre_um", "debris.mucus.fibre_width_um"),
    ("debris.red_cells.cluster_um", "debris.red_cells.cluster_radius_um"),
    ("debris.trichomonads.group_um", "debris.trichomonads.group_radius_um"),
    ("debris.trichomonads.nucleus", "debris.trichomonads.nucleus_absorbance"),
    ("focus.fused_noise_across", "focus.noise_correlation_x"),
    ("focus.fused_noise_down", "focus.noise_correlation_y"),
    ("focus.fused_noise_skew", "focus.noise_correlation_diagonal"),
    ("focus.picture", "focus.output"),
    ("nucleus.wedge", "nucleus.thickness_gradient"),
    ("scan.deposit.outside", "scan.deposit.outside_density"),
    ("scan.deposit.patch_um", "scan.deposit.density_scale_um"),
    ("scan.deposit.unevenness", "scan.deposit.density_variation"),
    ("scan.reach_um", "scan.max_object_radius_um"),
    ("scan.shading_left", "scan.residual_shading"),
    ("slide.fields", "slide.fields_per_slide"),
    ("slide.median_um", "slide.depth_filter_um"),
    ("slide.relief_um", "slide.depth_scale_um"),
];

/// Key path, former value, present value.
const VALUES: &[(&str, &str, &str)] = &[
    ("background.illumination.kind", "bowl", "quadratic"),
    ("camera.jpeg_subsampling", "columns", "4:2:2"),
    ("camera.jpeg_subsampling", "full", "4:4:4"),
    ("camera.jpeg_subsampling", "squares", "4:2:0"),
    ("cells.*.group.form", "alone", "single"),
    ("cells.*.group.form", "heap", "aggregate"),
    ("focus.output", "extended", "edf"),
    ("layout.kind", "map", "density-map"),
    ("layout.kind", "swath", "band"),
];

/// Returns the present path of a key, if the path is a former one.
pub(super) fn key(path: &[String]) -> Option<&'static str> {
    let path = general(path);
    KEYS.iter().find(|(former, _)| *former == path).map(|(_, present)| *present)
}

/// Returns the present form of a value, if the value is a former one of its key.
pub(super) fn value(path: &[String], value: &str) -> Option<&'static str> {
    let path = general(path);
    VALUES.iter().find(|(key, former, _)| *key == path && *former == value).map(|(.., present)| *present)
}

/// The dotted path, with `*` in place of a class of cells.
fn general(path: &[String]) -> String {
    let is_class = |index: usize| index == 1 && path[0] == "cells";
    let names = path.iter().enumerate().map(|(index, name)| if is_class(index) { "*" } else { name.as_str() });
    names.collect::<Vec<_>>().join(".")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recipe::diagnose::Schema;

    fn parts(path: &str) -> Vec<String> {
        path.split('.').map(str::to_owned).collect()
    }

    #[test]
    fn former_names_are_unknown_and_present_names_are_keys() {
        let schema = Schema::new();
        for (former, present) in KEYS {
            assert!(schema.at(&parts(former)).is_none(), "{former} is a key");
            assert!(schema.at(&parts(present)).is_some(), "{present} is no key");
            assert_eq!(key(&parts(former)), Some(*present));
        }
        for (path, former, present) in VALUES {
            let (section, name) = path.rsplit_once('.').unwrap();
            let section = schema.at(&parts(section)).unwrap();
            let words = if name == "kind" { section.kinds() } else { section.field(name, None).unwrap().words() };
            assert!(words.contains(present) && !words.contains(former), "{path}: {words:?}");
            assert_eq!(value(&parts(&path.replace('*', "any")), former), Some(*present));
        }
    }
}
