//! A macro for enumerations whose values have names.

/// Declares an enumeration with a name for each value.
macro_rules! words {
    ($(#[$meta:meta])* pub enum $Name:ident { $($(#[$doc:meta])* $Word:ident = $name:literal,)* }) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum $Name { $($(#[$doc])* $Word,)* }

        impl $Name {
            /// All values, in order of declaration.
            pub const ALL: [Self; [$($name),*].len()] = [$(Self::$Word),*];

            /// Returns the name.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$Word => $name,)*
                }
            }

            /// Returns the value with this name.
            #[must_use]
            pub fn by_name(name: &str) -> Option<Self> {
                Self::ALL.into_iter().find(|word| word.name() == name)
            }
        }
    };
}

pub(crate) use words;
