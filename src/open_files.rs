//! The limit of open files of this process.

use rustix::process::{Resource, getrlimit, setrlimit};

/// Raises the limit to the largest that the system allows this process. The usual limit, 1,024, is kept small
/// for programs that call `select(2)`; chainage does not. If the system refuses, the limit stays.
pub(crate) fn raise_limit() {
    let mut limit = getrlimit(Resource::Nofile);
    limit.current = limit.maximum;
    let _ = setrlimit(Resource::Nofile, limit);
}
