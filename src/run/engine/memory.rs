//! Memory as the system reports it: free memory, and the peak of this process.

use std::path::Path;

/// Memory that is assumed if the system does not report free memory.
const UNKNOWN_FREE_BYTES: u64 = 4 << 30;

/// Bytes of memory that are free for this process: the smaller of what the host has free and what the limits
/// of its control groups leave. Containers and batch systems such as Slurm set such limits.
pub(crate) fn free_bytes() -> u64 {
    let of_host = status_kib("/proc/meminfo", "MemAvailable:").map_or(UNKNOWN_FREE_BYTES, |kib| kib << 10);
    let groups = fs_err::read_to_string("/proc/self/cgroup").unwrap_or_default();
    left_in_groups(&groups, Path::new("/sys/fs/cgroup")).map_or(of_host, |left| left.min(of_host))
}

/// Names of the files of a control group: its limit, its use, and the field of `memory.stat` with the part of
/// the use that the system can reclaim.
struct GroupFiles {
    limit: &'static str,
    used: &'static str,
    reclaimed: &'static str,
}

const VERSION_1: GroupFiles = GroupFiles {
    limit: "memory.limit_in_bytes",
    used: "memory.usage_in_bytes",
    reclaimed: "total_inactive_file ",
};
const VERSION_2: GroupFiles =
    GroupFiles { limit: "memory.max", used: "memory.current", reclaimed: "inactive_file " };

/// Bytes that the limits of the control groups leave; `None` without a limit. `groups` is the text of
/// `/proc/self/cgroup` (`cgroups(7)`), `root` is where the groups are mounted.
fn left_in_groups(groups: &str, root: &Path) -> Option<u64> {
    let of_line = |line: &str| {
        let mut fields = line.splitn(3, ':');
        let (controllers, path) = (fields.nth(1)?, fields.next()?);
        let (mount, files) = match controllers {
            "" => (root.to_owned(), VERSION_2),
            _ if controllers.split(',').any(|name| name == "memory") => (root.join("memory"), VERSION_1),
            _ => return None,
        };
        // In a container, the path is often the path on the host, and only the mounted root exists.
        let group = mount.join(path.trim_start_matches('/'));
        let above = group.ancestors().take_while(|above| above.starts_with(&mount));
        above.filter_map(|group| left_in_group(group, &files)).min()
    };
    groups.lines().filter_map(of_line).min()
}

fn left_in_group(group: &Path, files: &GroupFiles) -> Option<u64> {
    let read = |name: &str| fs_err::read_to_string(group.join(name)).ok();
    let number = |name: &str| read(name)?.trim().parse::<u64>().ok();
    // "max" means no limit.
    let limit = number(files.limit)?;
    let stat = read("memory.stat").unwrap_or_default();
    let reclaimed =
        stat.lines().find_map(|line| line.strip_prefix(files.reclaimed)?.trim().parse::<u64>().ok());
    let used = number(files.used)?.saturating_sub(reclaimed.unwrap_or(0));
    Some(limit.saturating_sub(used))
}

/// Peak resident set of this process in bytes, mapped pages included. `None` if the system does not report
/// it.
pub(crate) fn peak_resident_bytes() -> Option<u64> {
    status_kib("/proc/self/status", "VmHWM:").map(|kib| kib << 10)
}

fn status_kib(path: &str, field: &str) -> Option<u64> {
    let text = fs_err::read_to_string(path).ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix(field))?;
    line.split_whitespace().next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_of_control_groups_and_of_those_above_them_count() {
        let root = tempfile::tempdir().unwrap();
        let write = |path: &str, text: &str| {
            let path = root.path().join(path);
            fs_err::create_dir_all(path.parent().unwrap()).unwrap();
            fs_err::write(path, text).unwrap();
        };
        let left = |groups: &str| left_in_groups(groups, root.path());
        assert_eq!(left("0::/job/step\n"), None, "no files");
        write("job/memory.max", "1000\n");
        write("job/memory.current", "700\n");
        write("job/memory.stat", "anon 400\ninactive_file 300\n");
        write("job/step/memory.max", "max\n");
        write("job/step/memory.current", "100\n");
        assert_eq!(left("0::/job/step\n"), Some(600));
        write("job/step/memory.max", "150\n");
        assert_eq!(left("0::/job/step\n"), Some(50));
        assert_eq!(left("0::/\n"), None);
        write("memory/job/memory.limit_in_bytes", "2000\n");
        write("memory/job/memory.usage_in_bytes", "2500\n");
        assert_eq!(left("5:cpu,cpuacct:/job\n4:memory:/job\n"), Some(0));
        // A container sees the path on the host, but its own root.
        write("memory/memory.limit_in_bytes", "900\n");
        write("memory/memory.usage_in_bytes", "100\n");
        assert_eq!(left("4:memory:/docker/1f2e\n"), Some(800));
        assert_eq!(left("no line of it"), None);
    }
}
