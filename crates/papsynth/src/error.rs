//! What can go wrong.

use crate::recipe::Problem;

/// Why an engine cannot be made, or an image not drawn.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The recipe asks for something that cannot be.
    #[error("the recipe has {} that cannot be:{}", count(.0), list(.0))]
    Recipe(Vec<Problem>),
    /// The model cannot be used.
    #[error("the model: {0}")]
    Model(String),
    /// A class cannot be learned from the material given.
    #[error("class `{class}` cannot be learned: {message}")]
    Learn {
        /// The class.
        class: String,
        /// Why, and what would help.
        message: String,
    },
    /// The weight map or label image that the layout names was not given, or cannot be used.
    #[error("layout: {0}")]
    Layout(String),
    /// An image cannot be drawn from this recipe.
    #[error("image {index} cannot be drawn: {message}")]
    Image {
        /// Index of the image.
        index: u64,
        /// Why, and what would help.
        message: String,
    },
}

fn count(problems: &[Problem]) -> String {
    match problems.len() {
        1 => "a field".to_owned(),
        n => format!("{n} fields"),
    }
}

fn list(problems: &[Problem]) -> String {
    problems.iter().map(|p| format!("\n  {p}")).collect()
}
