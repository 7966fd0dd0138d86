//! Facts about this host from the operating system: its name, its processes, and whether a file system is
//! shared with other hosts.

use std::path::Path;
use std::sync::OnceLock;

/// Longest part of a host's name that is used in names of files.
const LONGEST_NAME: usize = 40;

/// Name of this host, from characters that a file name may have.
pub(crate) fn name() -> &'static str {
    static NAME: OnceLock<String> = OnceLock::new();
    NAME.get_or_init(|| {
        let told = rustix::system::uname();
        let told = told.nodename().to_string_lossy();
        let plain = |c: char| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' };
        short(&told.chars().map(plain).collect::<String>())
    })
}

/// A name that is not too long. A shortened name ends with a digest, because the names of many hosts often
/// differ only at their ends (pods: `job-name-x7k2p`).
fn short(name: &str) -> String {
    match name.len() {
        0 => "host".to_owned(),
        1..=LONGEST_NAME => name.to_owned(),
        _ => {
            format!("{}-{:08x}", &name[..LONGEST_NAME - 9], xxhash_rust::xxh3::xxh3_64(name.as_bytes()) >> 32)
        }
    }
}

/// Whether a process of this host is alive, including processes of other users.
pub(crate) fn is_alive(process: u32) -> bool {
    let Some(process) = i32::try_from(process).ok().and_then(rustix::process::Pid::from_raw) else {
        return false;
    };
    // If the right to signal a process is missing, the process still exists.
    !matches!(rustix::process::test_kill_process(process), Err(rustix::io::Errno::SRCH))
}

/// File systems over a network or in user space, by the number that `statfs` gives them on Linux (`statfs(2)`
/// and `linux/magic.h`). On them a mapped file may change its length without notice, and pages are fetched
/// one by one.
const SHARED: [(u32, &str); 9] = [
    (0x6969, "NFS"),
    (0x517B, "SMB"),
    (0xFF53_4D42, "SMB"),
    (0xFE53_4D42, "SMB"),
    (0x0BD0_0BD0, "Lustre"),
    (0x6573_5546, "FUSE"),
    (0x00C3_6400, "Ceph"),
    (0x4750_4653, "GPFS"),
    (0x1983_0326, "BeeGFS"),
];

/// The kind of the file system with this number, if other hosts may share it.
fn shared_kind(number: u32) -> Option<&'static str> {
    SHARED.iter().find(|known| known.0 == number).map(|known| known.1)
}

/// The kind of the file system of `path`, if other hosts may share it. Also `None` if the system does not
/// say.
#[cfg(target_os = "linux")]
pub(crate) fn shared_file_system(path: &Path) -> Option<&'static str> {
    let facts = rustix::fs::statfs(path).ok()?;
    // The type of the number differs among architectures; its value has 32 bits.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "only the lower 32 bits are the number"
    )]
    shared_kind(facts.f_type as u32)
}

/// Other systems are not asked.
#[cfg(not(target_os = "linux"))]
pub(crate) fn shared_file_system(_path: &Path) -> Option<&'static str> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn this_process_is_alive_and_one_that_ended_is_not() {
        assert!(is_alive(std::process::id()));
        let mut child = std::process::Command::new("true").spawn().unwrap();
        let ended = child.id();
        child.wait().unwrap();
        assert!(!is_alive(ended));
        assert!(!is_alive(0) && !is_alive(u32::MAX));
    }

    #[test]
    fn long_names_that_differ_at_their_ends_stay_apart() {
        let [one, other] = ["a", "b"].map(|end| short(&format!("{}{end}", "x".repeat(62))));
        assert!(one.len() == LONGEST_NAME && other.len() == LONGEST_NAME && one != other, "{one} {other}");
        assert_eq!(
            [short("node-7"), short(&"y".repeat(LONGEST_NAME)), short("")],
            ["node-7".to_owned(), "y".repeat(LONGEST_NAME), "host".to_owned()]
        );
    }

    #[test]
    fn file_systems_of_a_network_are_known_by_their_numbers() {
        assert_eq!(shared_kind(0x6969), Some("NFS"));
        assert_eq!(shared_kind(0xEF53), None, "ext4");
        assert_eq!(shared_kind(0x0102_1994), None, "tmpfs");
        assert!(shared_file_system(Path::new("/proc")).is_none());
        assert!(shared_file_system(Path::new("/no/such/folder")).is_none());
        assert!(name().chars().all(|c| c.is_ascii_alphanumeric() || "-_".contains(c)) && !name().is_empty());
    }
}
