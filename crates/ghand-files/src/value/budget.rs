//! Limits on the content of one file.

use std::cell::Cell;

/// Most numbers of a file, 256 MiB as f64.
const MAX_NUMBERS: usize = 1 << 25;

/// Most values of a file that are not numbers of an array; each takes some 100 bytes.
const MAX_VALUES: usize = 1 << 22;

/// The rest that may still be read.
pub(super) struct Budget {
    numbers: Cell<usize>,
    values: Cell<usize>,
}

impl Budget {
    pub(super) fn new() -> Budget {
        Budget { numbers: Cell::new(MAX_NUMBERS), values: Cell::new(MAX_VALUES) }
    }

    /// Takes numbers of the budget.
    pub(super) fn numbers(&self, count: usize) -> Result<(), String> {
        take(&self.numbers, count, "numbers", MAX_NUMBERS)
    }

    /// Takes other values of the budget.
    pub(super) fn values(&self, count: usize) -> Result<(), String> {
        take(&self.values, count, "values", MAX_VALUES)
    }
}

fn take(left: &Cell<usize>, count: usize, what: &str, most: usize) -> Result<(), String> {
    let rest = left.get().checked_sub(count);
    left.set(rest.unwrap_or(0));
    rest.map(drop).ok_or_else(|| format!("has more than {most} {what}; split it, or keep only what is needed"))
}
