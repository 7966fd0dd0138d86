//! The native part of the Python package: drives of files, and points in arrays. The Python part checks
//! arguments, has the documentation, and makes exceptions of failures.

mod arrays;
mod drives;
mod failure;
mod points;
mod scores;
mod task;

use pyo3::prelude::*;

#[pymodule]
mod _native {
    #[pymodule_export]
    use crate::arrays::label;
    #[pymodule_export]
    use crate::drives::{columns, memory_range, plan, run, status};
    #[pymodule_export]
    use crate::failure::Failure;
    #[pymodule_export]
    use crate::scores::evaluate;
}
