//! The operations of `pointwise`: what each computes, its number in the shaders, and the shaders that compute it.
//!
//! They come in families, each with a text of its own, because software devices execute every branch of a text: the operations
//! that networks record ([`Family::Plain`]), those that losses add ([`Family::More`]), and gradients ([`Family::Gradient`]). Within a
//! family a costly operation has a software variant of its own.

use omnix_shaders::{Shader, pointwise as shaders};

/// An operation on one number.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Unary {
    /// `max(a, 0)`.
    Relu,
    /// `-a`.
    Neg,
    /// `|a|`.
    Abs,
    /// `a²`.
    Square,
    /// `1 / a`.
    Reciprocal,
    /// `a · s + t`.
    ScaleShift {
        /// Factor.
        s: f32,
        /// Addend.
        t: f32,
    },
    /// `min(max(a, low), high)`.
    Clamp {
        /// Least result.
        low: f32,
        /// Greatest result.
        high: f32,
    },
    /// `√a`.
    Sqrt,
    /// 1 where `a < limit`, else 0 (NaN included).
    Below {
        /// What a is compared with.
        limit: f32,
    },
    /// The erf form, `a Φ(a)`.
    Gelu,
    /// `a / (1 + exp(-a))`.
    Silu,
    /// `1 / (1 + exp(-a))`.
    Sigmoid,
    /// `log(1 + exp(a))`, beyond 20 the identity.
    Softplus,
    /// `exp(a)`.
    Exp,
    /// Natural logarithm.
    Log,
    /// `exp(min(max(a, low), high))`.
    ExpClamped {
        /// Least exponent.
        low: f32,
        /// Greatest exponent.
        high: f32,
    },
    /// Hyperbolic tangent.
    Tanh,
    /// 1, 0 or −1 as a is above, equal to or below 0; 0 for NaN.
    Sign,
    /// 1 where a is neither NaN nor infinite, else 0.
    IsFinite,
    /// `a` to the power `exponent`. A negative a has a power where the exponent is an integer; otherwise the result is NaN.
    Power {
        /// The exponent.
        exponent: f32,
    },
}

/// An operation on two numbers, `a op b`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Binary {
    /// `a + b`.
    Add,
    /// `a - b`.
    Sub,
    /// `a · b`.
    Mul,
    /// The greater.
    Max,
    /// The smaller.
    Min,
    /// `a / b`.
    Div,
    /// 1 where `a = b`, else 0 (NaN included).
    Equal,
    /// 1 where `a < b`, else 0 (NaN included).
    Less,
    /// a where b is not 0, else 0: a mask that takes NaN out, which a product with 0 does not.
    Keep,
    /// a where b is 0, else 0: the same with the mask's opposite.
    Drop,
}

/// The texts of `pointwise`; each numbers its operations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Family {
    Plain,
    More,
    Gradient,
    Select,
}

impl Family {
    /// The variants of every WebGPU device: words, and four at a time.
    pub(super) const fn shaders(self) -> [&'static Shader; 2] {
        match self {
            Self::Plain => [&shaders::WORDS, &shaders::VEC4],
            Self::More => [&shaders::WORDS_MORE, &shaders::VEC4_MORE],
            Self::Gradient => [&shaders::WORDS_GRADIENT, &shaders::VEC4_GRADIENT],
            Self::Select => [&shaders::WORDS_SELECT, &shaders::VEC4_SELECT],
        }
    }
}

/// How shaders know an operation: its family, its number there, two constants, and the software variant that computes it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Code {
    pub(super) family: Family,
    pub(super) number: u32,
    pub(super) s: f32,
    pub(super) t: f32,
    pub(super) software: &'static Shader,
}

/// The number of the first operation on one number in the plain family.
pub(super) const UNARY: u32 = 6;

impl Unary {
    /// Number in the texts of plain operations and of gradients, and its two constants; those from 23 on are in the family
    /// of [`Unary::more`] and have numbers here for their gradients alone.
    const fn number(self) -> (u32, f32, f32) {
        match self {
            Self::Relu => (6, 0.0, 0.0),
            Self::Neg => (7, 0.0, 0.0),
            Self::Abs => (8, 0.0, 0.0),
            Self::Square => (9, 0.0, 0.0),
            Self::ScaleShift { s, t } => (10, s, t),
            Self::Clamp { low, high } => (11, low, high),
            Self::Below { limit } => (12, limit, 0.0),
            Self::Reciprocal => (13, 0.0, 0.0),
            Self::Sqrt => (14, 0.0, 0.0),
            Self::Gelu => (15, 0.0, 0.0),
            Self::Silu => (16, 0.0, 0.0),
            Self::Sigmoid => (17, 0.0, 0.0),
            Self::Softplus => (18, 0.0, 0.0),
            Self::Exp => (19, 0.0, 0.0),
            Self::Log => (20, 0.0, 0.0),
            Self::ExpClamped { low, high } => (21, low, high),
            Self::Tanh => (22, 0.0, 0.0),
            // Steps, whose gradient is that of `Below`: 0.
            Self::Sign | Self::IsFinite => (12, 0.0, 0.0),
            Self::Power { exponent } => (23, exponent, 0.0),
        }
    }

    /// Number in the text of the operations that losses add.
    const fn more(self) -> Option<u32> {
        match self {
            Self::Sign => Some(4),
            Self::IsFinite => Some(5),
            Self::Power { .. } => Some(6),
            _ => None,
        }
    }

    /// How shaders know it.
    pub(super) const fn code(self) -> Code {
        let (number, s, t) = self.number();
        if let Some(number) = self.more() {
            let software = match self {
                Self::Power { .. } => &shaders::SOFTWARE_POWER,
                _ => &shaders::SOFTWARE_MORE,
            };
            return Code { family: Family::More, number, s, t, software };
        }
        let software = match self {
            Self::Reciprocal => &shaders::SOFTWARE_RECIPROCAL,
            Self::Sqrt => &shaders::SOFTWARE_SQRT,
            Self::Gelu => &shaders::SOFTWARE_GELU,
            Self::Silu => &shaders::SOFTWARE_SILU,
            Self::Sigmoid => &shaders::SOFTWARE_SIGMOID,
            Self::Softplus => &shaders::SOFTWARE_SOFTPLUS,
            Self::Exp => &shaders::SOFTWARE_EXP,
            Self::Log => &shaders::SOFTWARE_LOG,
            Self::ExpClamped { .. } => &shaders::SOFTWARE_EXP_CLAMPED,
            Self::Tanh => &shaders::SOFTWARE_TANH,
            _ => &shaders::SOFTWARE,
        };
        Code { family: Family::Plain, number, s, t, software }
    }

    /// How shaders know its gradient.
    pub(super) const fn gradient(self) -> Code {
        let (number, s, t) = self.number();
        let software = match self {
            Self::Reciprocal => &shaders::SOFTWARE_GRADIENT_RECIPROCAL,
            Self::Sqrt => &shaders::SOFTWARE_GRADIENT_SQRT,
            Self::Gelu => &shaders::SOFTWARE_GRADIENT_GELU,
            Self::Silu => &shaders::SOFTWARE_GRADIENT_SILU,
            // The derivative of softplus is sigmoid, but that of sigmoid is another function.
            Self::Sigmoid => &shaders::SOFTWARE_GRADIENT_SIGMOID,
            Self::Softplus => &shaders::SOFTWARE_GRADIENT_SOFTPLUS,
            Self::Exp => &shaders::SOFTWARE_GRADIENT_EXP,
            Self::Log => &shaders::SOFTWARE_GRADIENT_LOG,
            Self::ExpClamped { .. } => &shaders::SOFTWARE_GRADIENT_EXP_CLAMPED,
            Self::Tanh => &shaders::SOFTWARE_GRADIENT_TANH,
            Self::Power { .. } => &shaders::SOFTWARE_GRADIENT_POWER,
            _ => &shaders::SOFTWARE_GRADIENT,
        };
        Code { family: Family::Gradient, number, s, t, software }
    }
}

impl Binary {
    /// How shaders know it.
    pub(super) const fn code(self) -> Code {
        let (family, number) = match self {
            Self::Add => (Family::Plain, 0),
            Self::Sub => (Family::Plain, 1),
            Self::Mul => (Family::Plain, 2),
            Self::Max => (Family::Plain, 3),
            Self::Min => (Family::Plain, 4),
            Self::Div => (Family::Plain, 5),
            Self::Equal => (Family::More, 0),
            Self::Less => (Family::More, 1),
            Self::Keep => (Family::More, 2),
            Self::Drop => (Family::More, 3),
        };
        let software = match family {
            Family::More => &shaders::SOFTWARE_MORE,
            _ => &shaders::SOFTWARE,
        };
        Code { family, number, s: 0.0, t: 0.0, software }
    }
}

/// How shaders know the choice between two numbers.
pub(super) const SELECT: Code =
    Code { family: Family::Select, number: 0, s: 0.0, t: 0.0, software: &shaders::SOFTWARE_SELECT };
