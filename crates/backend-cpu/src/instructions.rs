//! Which instructions devices trace with.

use rt_simd::{Isa, Kernel};
use std::fmt;

/// The variable that chooses instructions, for tests and comparisons.
const VARIABLE: &str = "RAYBALANCE_ISA";

/// The kernels for the instructions that the caller names, else those that the environment names, else the processor's
/// best.
pub(crate) fn kernel(isa: Option<Isa>) -> Result<Kernel, InstructionsError> {
    let variable = || std::env::var_os(VARIABLE).map(|name| name.to_string_lossy().into_owned());
    chosen(isa, variable)
}

fn chosen(isa: Option<Isa>, variable: impl FnOnce() -> Option<String>) -> Result<Kernel, InstructionsError> {
    if let Some(isa) = isa {
        return Kernel::new(isa).ok_or(InstructionsError { variable: None, isa: Some(isa) });
    }
    let Some(name) = variable() else {
        return Ok(Kernel::best());
    };
    let isa = name.parse().ok();
    isa.and_then(Kernel::new).ok_or(InstructionsError { variable: Some(name), isa })
}

/// Instructions that are asked for and cannot be had.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InstructionsError {
    /// What the environment variable says, if that asks for them.
    variable: Option<String>,
    /// Which they are; `None` where the name is nobody's.
    isa: Option<Isa>,
}

impl fmt::Display for InstructionsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(value) = &self.variable {
            write!(f, "the environment variable {VARIABLE}={value}: ")?;
        }
        match self.isa {
            Some(isa) => write!(f, "this processor lacks {isa}")?,
            None => f.write_str("no such instructions")?,
        }
        f.write_str("; it has ")?;
        for (i, isa) in Isa::available().into_iter().enumerate() {
            write!(f, "{}{isa}", if i > 0 { ", " } else { "" })?;
        }
        Ok(())
    }
}

impl std::error::Error for InstructionsError {}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mutants: the environment goes before the caller; a name that is nobody's is passed over.
    #[test]
    fn the_caller_goes_before_the_environment_and_nothing_is_passed_over() {
        let best = Kernel::best().isa();
        assert_eq!(chosen(None, || None).map(Kernel::isa), Ok(best));
        assert_eq!(chosen(None, || Some("portable".to_owned())).map(Kernel::isa), Ok(Isa::Portable));
        assert_eq!(chosen(Some(best), || Some("portable".to_owned())).map(Kernel::isa), Ok(best));
        for bad in ["", "sse", "AVX2", "avx512 "] {
            let message = chosen(None, || Some(bad.to_owned())).map(Kernel::isa).unwrap_err().to_string();
            assert!(message.contains(&format!("RAYBALANCE_ISA={bad}: no such")), "{message}");
            assert!(message.ends_with(best.name()), "{message}");
        }
    }
}
