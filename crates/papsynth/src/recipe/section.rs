//! The declaration of sections: each number of a recipe is declared once, with documentation, default, range and unit.
//!
//! The declaration generates the struct with its documentation, `Default`, reading and writing, the bounds of the JSON
//! schema, the checks of [`Recipe::problems`](super::Recipe::problems) and, for a section that is drawn number by
//! number, the drawn struct and the names of the streams.

use std::borrow::Cow;

use super::conditions::NumberMut;
use super::number::Number;

/// The range of a number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Bounds {
    pub(crate) low: f64,
    pub(crate) high: f64,
    /// Whether it is a count: fixed values must be integers.
    pub(crate) whole: bool,
}

/// A declared number of a recipe and its value.
#[derive(Debug, Clone)]
pub(crate) struct Declared<'a> {
    /// The dotted path of the field.
    pub(crate) path: String,
    pub(crate) value: Value<'a>,
    pub(crate) bounds: Bounds,
}

/// The value of a declared number.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Value<'a> {
    /// A number or a distribution.
    Real(Cow<'a, Number>),
    /// A density per mm².
    Density(&'a Number),
    /// An integer, exact beyond 2⁵³.
    Whole(u64),
}

impl Declared<'_> {
    /// Returns messages about an invalid value: its range, and whether it is an integer.
    pub(crate) fn problems(&self) -> impl Iterator<Item = String> {
        let Bounds { low, high, whole } = self.bounds;
        let [range, fraction] = match &self.value {
            Value::Real(number) => [number.problem(low, high), number.fraction().filter(|_| whole)],
            Value::Density(number) => [number.problem(low, high).map(|problem| format!("{problem} per mm²")), None],
            Value::Whole(value) => {
                let outside = *value < low as u64 || *value > high as u64;
                [outside.then(|| format!("{value} is out of range: expected {low} to {high}")), None]
            }
        };
        range.into_iter().chain(fraction)
    }
}

/// A part of a recipe: a section, a number, or a word or a string, which have no declared numbers.
pub(crate) trait Part {
    /// Appends the numbers of the part at `path`. `bounds` are those of the field, if it is a number.
    fn list<'a>(&'a self, _path: &str, _bounds: Option<Bounds>, _found: &mut Vec<Declared<'a>>) {}

    /// Returns the number at a dotted path inside the part, if it may be a distribution.
    fn number_mut(&mut self, _path: &str) -> Option<NumberMut<'_>> {
        None
    }
}

macro_rules! numbers {
    ($($Type:ty: $number:ident => $value:expr $(, as $Variant:ident)?;)*) => {
        $(impl Part for $Type {
            fn list<'a>(&'a self, path: &str, bounds: Option<Bounds>, found: &mut Vec<Declared<'a>>) {
                let $number = self;
                found.extend(bounds.map(|bounds| Declared { path: path.to_owned(), value: $value, bounds }));
            }

            $(fn number_mut(&mut self, path: &str) -> Option<NumberMut<'_>> {
                path.is_empty().then_some(NumberMut::$Variant(self))
            })?
        })*
    };
}
numbers! {
    Number: number => Value::Real(Cow::Borrowed(number)), as Real;
    f64: number => Value::Real(Cow::Owned(Number::Fixed(*number)));
    u32: number => Value::Whole((*number).into());
    u64: number => Value::Whole(*number);
    usize: number => Value::Whole(*number as u64);
}

impl Part for String {}

/// Returns the dotted path of a field of the part at `path`.
pub(crate) fn within(path: &str, field: &str) -> String {
    if path.is_empty() { field.to_owned() } else { format!("{path}.{field}") }
}

/// Declares a section of a recipe, or a choice of words or of sections.
///
/// A field is `name: Kind = default, low..=high, "unit";`. `Kind` is [`Number`], [`Count`](super::Count),
/// [`Abundance`](super::Abundance), a plain number, or the type of a word, a string or another section, which have no
/// range. A section needs no default.
///
/// With `drawn as pub Name`, the struct `Name` has a drawn value of each field, and `draw` draws each from the stream
/// with the dotted path of the field. With `drawn from rng as pub Name`, `one` draws all fields from one stream, in
/// their order; dyes are zero there, and set by the caller. A field marked `(undrawn)` is omitted, a field marked
/// `(last)` follows the others. `(Count as name: "Documentation.")` renames the drawn value; `Chance` in place of
/// `Count` draws whether the event occurs. The caller sets fields marked `(given Type)` or `(given Type as name:
/// "Documentation.")`, and fields listed after `also`.
macro_rules! section {
    ($(#[$meta:meta])* pub struct $Name:ident $(, drawn $(from $source:ident)? as $visible:vis $Drawn:ident)? {
        $($(#[$about:meta])* $field:ident: $Kind:ident $(($($mark:tt)*))? $(= $default:expr $(, $low:literal..=$high:literal $(, $unit:literal)?)?)?;)*
    } $(also { $($(#[$more:meta])* $extra:ident: $Type:ident,)* })?) => {
        #[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
        #[serde(default, deny_unknown_fields)]
        $(#[$meta])*
        pub struct $Name {
            $(
                $(#[$about])*
                $($(
                    #[doc = concat!("From ", stringify!($low), " to ", stringify!($high), $(" ", $unit,)? ".")]
                    #[schemars(extend("minimum" = $low, "maximum" = $high))]
                )?)?
                pub $field: $Kind,
            )*
        }

        impl Default for $Name {
            fn default() -> Self {
                Self { $($field: section!(@default $Kind $($default)?),)* }
            }
        }

        impl $crate::recipe::section::Part for $Name {
            fn list<'a>(
                &'a self,
                path: &str,
                _: Option<$crate::recipe::section::Bounds>,
                found: &mut Vec<$crate::recipe::section::Declared<'a>>,
            ) {
                $(
                    let path_of_field = $crate::recipe::section::within(path, stringify!($field));
                    self.$field.list(&path_of_field, section!(@bounds $Kind $($($low $high)?)?), found);
                )*
            }

            fn number_mut(&mut self, path: &str) -> Option<$crate::recipe::conditions::NumberMut<'_>> {
                let (field, inner) = path.split_once('.').unwrap_or((path, ""));
                match field {
                    $(stringify!($field) => self.$field.number_mut(inner),)*
                    _ => None,
                }
            }
        }

        section!(@drawn $Name ($(($($source)?) $visible $Drawn)?) [] [] $({
            [$(#[$about])* $($($(#[doc = concat!("In ", $unit, ".")])?)?)?] $field $Kind ($($($mark)*)?) ($($($low)?)?)
        })* $($({ [$(#[$more])*] $extra $Type () given })*)?);
    };

    ($(#[$meta:meta])* pub enum $Name:ident { $($(#[$about:meta])* $Word:ident,)* }) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
        #[serde(rename_all = "kebab-case")]
        pub enum $Name { $($(#[$about])* $Word,)* }

        impl $crate::recipe::section::Part for $Name {}
    };

    ($(#[$meta:meta])* pub enum $Name:ident, by default $Default:ident {
        $($(#[$about:meta])* $Variant:ident($Section:ident),)*
    }) => {
        $(#[$meta])*
        #[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
        #[serde(tag = "kind", rename_all = "kebab-case")]
        pub enum $Name { $($(#[$about])* $Variant($Section),)* }

        impl Default for $Name {
            fn default() -> Self {
                Self::$Default(Default::default())
            }
        }

        impl $crate::recipe::section::Part for $Name {
            fn list<'a>(
                &'a self,
                path: &str,
                bounds: Option<$crate::recipe::section::Bounds>,
                found: &mut Vec<$crate::recipe::section::Declared<'a>>,
            ) {
                match self {
                    $(Self::$Variant(section) => section.list(path, bounds, found),)*
                }
            }

            fn number_mut(&mut self, path: &str) -> Option<$crate::recipe::conditions::NumberMut<'_>> {
                match self {
                    $(Self::$Variant(section) => section.number_mut(path),)*
                }
            }
        }
    };

    (@default Number $default:expr) => { $crate::recipe::number::Number::from($default) };
    (@default Count $default:expr) => { $crate::recipe::number::Number::from($default) };
    (@default Abundance $default:expr) => { $crate::recipe::abundance::Abundance::from($default) };
    (@default $Kind:ident $default:expr) => { $default };
    (@default $Kind:ident) => { <$Kind>::default() };

    (@bounds $Kind:ident) => { None };
    (@bounds Count $low:literal $high:literal) => {
        Some($crate::recipe::section::Bounds { low: $low as f64, high: $high as f64, whole: true })
    };
    (@bounds Abundance $low:literal $high:literal) => {
        Some($crate::recipe::section::Bounds { low: $low as f64, high: $high as f64, whole: true })
    };
    (@bounds $Kind:ident $low:literal $high:literal) => {
        Some($crate::recipe::section::Bounds { low: $low as f64, high: $high as f64, whole: false })
    };

    // Field by field: drawn fields, then fields marked `(last)`.
    (@drawn $Name:ident () $($rest:tt)*) => {};
    (@drawn $Name:ident $drawn:tt [$($done:tt)*] [$($last:tt)*] { $about:tt $field:ident $Kind:ident (undrawn) $low:tt } $($rest:tt)*) => {
        section!(@drawn $Name $drawn [$($done)*] [$($last)*] $($rest)*);
    };
    (@drawn $Name:ident $drawn:tt [$($done:tt)*] [$($last:tt)*] { $about:tt $field:ident $Kind:ident (last) $low:tt } $($rest:tt)*) => {
        section!(@drawn $Name $drawn [$($done)*] [$($last)* { $about $field $field $Kind $low }] $($rest)*);
    };
    (@drawn $Name:ident $drawn:tt [$($done:tt)*] $last:tt { $about:tt $field:ident $Kind:ident (given $Type:tt) $low:tt } $($rest:tt)*) => {
        section!(@drawn $Name $drawn [$($done)* { $about $field $field $Type given }] $last $($rest)*);
    };
    (@drawn $Name:ident $drawn:tt [$($done:tt)*] $last:tt { $about:tt $field:ident $Kind:ident (given $Type:tt as $own:ident: $doc:literal) $low:tt } $($rest:tt)*) => {
        section!(@drawn $Name $drawn [$($done)* { [#[doc = $doc]] $own $field $Type given }] $last $($rest)*);
    };
    (@drawn $Name:ident $drawn:tt [$($done:tt)*] $last:tt { $about:tt $field:ident $Kind:ident ($How:ident as $own:ident: $doc:literal) $low:tt } $($rest:tt)*) => {
        section!(@drawn $Name $drawn [$($done)* { [#[doc = $doc]] $own $field $How $low }] $last $($rest)*);
    };
    (@drawn $Name:ident $drawn:tt [$($done:tt)*] $last:tt { $about:tt $field:ident $Kind:ident () $low:tt } $($rest:tt)*) => {
        section!(@drawn $Name $drawn [$($done)* { $about $field $field $Kind $low }] $last $($rest)*);
    };
    (@drawn $Name:ident ($source:tt $visible:vis $Drawn:ident) [$({ [$(#[$about:meta])*] $own:ident $field:ident $Kind:tt $low:tt })*] []) => {
        #[doc = concat!("Values drawn from [`", stringify!($Name), "`](crate::recipe::", stringify!($Name), ").")]
        #[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
        #[serde(deny_unknown_fields)]
        $visible struct $Drawn { $($(#[$about])* pub $own: section!(@value $source $Kind),)* }

        section!(@draw $source $Name $Drawn $({ $own $field $Kind $low })*);
    };
    (@drawn $Name:ident $drawn:tt [$($done:tt)*] [$($last:tt)*]) => {
        section!(@drawn $Name $drawn [$($done)* $($last)*] []);
    };
    (@draw () $Name:ident $Drawn:ident $({ $own:ident $field:ident $Kind:tt $low:tt })*) => {
        impl $Name {
            /// Draws each number from the stream with its dotted path. `path` is that of the section.
            pub(crate) fn draw(&self, path: &str, stream: impl Fn(&str) -> $crate::key::Stream) -> $Drawn {
                let stream = |field: &str| stream(&$crate::recipe::section::within(path, field));
                $Drawn { $($own: section!(@one () $Kind $low self.$field, &mut stream(stringify!($field))),)* }
            }
        }
    };
    (@draw (rng) $Name:ident $Drawn:ident $({ $own:ident $field:ident $Kind:tt $low:tt })*) => {
        impl $Name {
            /// Draws the numbers of one object.
            pub(crate) fn one(&self, rng: &mut $crate::key::Stream) -> $Drawn {
                $Drawn { $($own: section!(@one (rng) $Kind $low self.$field, rng),)* }
            }
        }
    };
    (@value $source:tt Number) => { f64 };
    (@value () Count) => { u32 };
    (@value (rng) Count) => { usize };
    (@value (rng) Chance) => { bool };
    (@value (rng) DyeAmounts) => { dye_spectra::Amounts };
    (@value $source:tt $Kind:tt) => { $Kind };
    (@one (rng) $Kind:tt given $number:expr, $rng:expr) => { Default::default() };
    (@one $source:tt Number $low:tt $number:expr, $rng:expr) => { $number.draw($rng) };
    (@one () Count ($low:literal) $number:expr, $rng:expr) => { ($number.draw_count($rng) as u32).max($low) };
    (@one (rng) Count ($low:literal) $number:expr, $rng:expr) => { $number.draw_count($rng).max($low) };
    (@one (rng) Chance $low:tt $number:expr, $rng:expr) => { $crate::random::chance($number.draw($rng), $rng) };
    (@one (rng) DyeAmounts $low:tt $number:expr, $rng:expr) => { Default::default() };
    (@one $source:tt $Kind:ident $low:tt $value:expr, $rng:expr) => { $value };
}

/// Returns the path of a number and the number: `named!(recipe.slide.depth_um)` has the path `slide.depth_um`, and
/// `named!(self.count)` the path `count`. With the path of a section, as in `named!("layout", band.width_um)`, the path
/// is `layout.width_um`.
macro_rules! named {
    ($section:literal, $owner:ident.$number:ident) => {
        (concat!($section, ".", stringify!($number)), &$owner.$number)
    };
    ($owner:ident.$first:ident $(.$rest:ident)*) => {
        (concat!(stringify!($first) $(, ".", stringify!($rest))*), &$owner.$first$(.$rest)*)
    };
}

pub(crate) use {named, section};
