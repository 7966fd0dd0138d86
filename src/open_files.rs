//! The limit of open files of this process.

use rustix::process::{Resource, getrlimit, setrlimit};

/// Raises the limit to the largest that the system allows this process. The usual one, 1,024, is kept small
/// for programs that call `select(2)`, which chainage does not. A system that refuses keeps its limit.
pub(crate) fn raise_limit() {
    let mut limit = getrlimit(Resource::Nofile);
    limit.current = limit.maximum;
    let _ = setrlimit(Resource::Nofile, limit);
}
