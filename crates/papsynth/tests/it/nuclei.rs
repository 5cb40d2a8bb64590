//! Nuclei and the cytoplasm that they displace.

use papsynth::key::Key;
use papsynth::model::Model;
use papsynth::recipe::Preset;
use papsynth::scene::{Body, CellBody};
use papsynth::{Engine, Inputs};

/// Stain of the cytoplasm of one class, in addition to that of the slide.
const STAIN: f64 = 0.6;

/// Returns the cells of twelve fields.
fn cells(displacement: f64) -> Vec<CellBody> {
    let mut recipe = Preset::Lbc.recipe();
    recipe.nucleus.displacement = displacement.into();
    recipe.stain.slide_cytoplasm = 1.0.into();
    recipe.stain.field_cytoplasm = 1.0.into();
    recipe.cells.get_mut("superficial").unwrap().cytoplasm_stain = STAIN.into();
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
