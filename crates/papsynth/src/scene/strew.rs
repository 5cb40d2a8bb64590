//! Debris among the cells of a field.

use super::field::Object;
use super::numbers::FieldNumbers;
use super::stain::FieldStain;
use super::view::View;
use crate::debris::ground::{CellPlace, Field, Sieve, Strewn};
use crate::debris::{Body, Debris};

/// Gives the cells of a field their coats, and adds everything that lies among them. `sieve` says what of it lies on a part
/// of a slide.
pub(super) fn strew(
    debris: &Debris,
    view: View,
    numbers: &FieldNumbers,
    stain: &FieldStain<'_>,
    sieve: Option<Sieve<'_>>,
    objects: &mut Vec<Object>,
) {
    debris.clue_cells.draw(numbers, objects.iter_mut().map(|cell| (cell.number, &mut cell.coat)));
    let place = |object: &Object| match &object.body {
        Body::Cell(body) => {
            let (centre_um, depth_um) = (object.centre_um, object.depth_um);
            Some(CellPlace { centre_um, depth_um, radius_um: body.radius_um })
        }
        _ => None,
    };
    let cells = objects.iter().filter_map(place).collect();
    let strewn = debris.draw(&Field { view, numbers, stain, cells, sieve });
    objects.extend(strewn.into_iter().map(|Strewn { number, cluster, lie, thing }| Object {
        id: 0,
        number,
        cluster,
        plot: None,
        centre_um: lie.centre_um,
        depth_um: lie.depth_um,
        rotation_deg: lie.rotation_deg,
        bethesda: String::new(),
        coat: None,
        body: thing,
    }));
}
