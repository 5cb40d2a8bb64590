//! Nuclei and the cytoplasm that they displace; strength of the texture of cytoplasm.

use papsynth::key::Key;
use papsynth::model::Model;
use papsynth::recipe::{Preset, Recipe};
use papsynth::scene::{Body, CellBody};
use papsynth::{Engine, Inputs};

/// Stain of the cytoplasm of one class, in addition to that of the slide.
const STAIN: f64 = 0.6;

/// Returns the cells of twelve fields.
fn cells(displacement: f64) -> Vec<CellBody> {
    cells_of(|recipe| {
        recipe.nucleus.displacement = displacement.into();
        recipe.cells.get_mut("superficial").unwrap().cytoplasm_stain = STAIN.into();
    })
}

/// Returns the cells of twelve fields of even stain.
fn cells_of(change: impl Fn(&mut Recipe)) -> Vec<CellBody> {
    let mut recipe = Preset::Lbc.recipe();
    recipe.stain.slide_cytoplasm = 1.0.into();
    recipe.stain.field_cytoplasm = 1.0.into();
    change(&mut recipe);
    let engine = Engine::new(&recipe, &Model::builtin(), &Inputs::default()).unwrap();
    let scenes = (0..12).map(|index| engine.scene(Key { seed: 6, index }).unwrap());
    let bodies = scenes.flat_map(|scene| scene.objects.into_iter().map(|object| object.body));
    bodies
        .filter_map(|body| match body {
            Body::Cell(cell) if !cell.nucleus.pyknotic => Some(*cell),
            _ => None,
        })
        .collect()
}

#[test]
fn nuclei_replace_the_displaced_part_of_a_cell_of_their_class() {
    const DISPLACEMENT: f64 = 0.8;
    let (model, [none, much]) = (Model::builtin(), [0.0, DISPLACEMENT].map(cells));
    assert!(none.len() == much.len() && none.len() > 100, "{}", none.len());
    for (none, much) in none.iter().zip(&much) {
        let stain = if none.class == "superficial" { STAIN } else { 1.0 };
        let expected = DISPLACEMENT * stain * model.classes[&none.class].cytoplasm.absorbance.median;
        let added = much.nucleus.absorbance - none.nucleus.absorbance;
        assert!((added - expected).abs() < 1e-6, "{}: {added} {expected}", none.class);
        assert!((much.cytoplasm_absorbance - none.cytoplasm_absorbance).abs() < 1e-12);
    }
}

#[test]
fn the_strength_of_texture_varies_only_with_thickness_without_variation() {
    let model = Model::builtin();
    let kinds = &model.cytoplasm_texture.as_ref().unwrap().kinds;
    let spreads = |variation: f64, deviation_of: fn([f64; 2]) -> f64| {
        let cells = cells_of(|recipe| recipe.stain.texture_variation = variation.into());
        let deviation = |cell: &CellBody| {
            let thickness = cell.cytoplasm_absorbance / model.classes[&cell.class].cytoplasm.absorbance.median;
            deviation_of([0, 1].map(|part| {
                let kind = kinds.iter().find(|kind| kind.name == cell.textures[part]).unwrap();
                libm::log(cell.detail.texture[part] * thickness.sqrt() / kind.strength.median)
            }))
        };
        let of_cells: Vec<f64> = cells.iter().filter(|cell| cell.class == "intermediate").map(deviation).collect();
        assert!(of_cells.len() > 100, "{}", of_cells.len());
        let mean = of_cells.iter().sum::<f64>() / of_cells.len() as f64;
        (of_cells.iter().map(|d| (d - mean) * (d - mean)).sum::<f64>() / of_cells.len() as f64).sqrt()
    };
    for part in [|[outer, _]: [f64; 2]| outer, |[_, inner]: [f64; 2]| inner] {
        assert!(spreads(0.0, part) < 1e-9);
        // The deviations of the model: about 0.25 between cells, and half of 0.23 between fields.
        let [half, whole] = [0.5, 1.0].map(|variation| spreads(variation, part));
        assert!((whole / half - 2.0).abs() < 1e-6 && (0.2..0.32).contains(&whole), "{half} {whole}");
    }
    // Both parts of a cell have a deviation of their own: in the difference, that of the field cancels.
    let difference = spreads(1.0, |[outer, inner]| outer - inner);
    assert!((0.25..0.5).contains(&difference), "{difference}");
}
