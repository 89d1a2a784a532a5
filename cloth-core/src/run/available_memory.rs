//! The memory that a process may still use, on Linux.

use std::fs;
use std::path::{Path, PathBuf};

/// Returns the memory that is available in bytes: that of the machine, within the limits of the control groups and of
/// the address space. `None` if the system does not tell. `root` is the root of the file system.
pub(super) fn available_memory(root: &Path) -> Option<u64> {
    let read = |path: &str| fs::read_to_string(root.join(path)).ok();
    let machine = read("proc/meminfo").and_then(|text| 1024_u64.checked_mul(entry(&text, "MemAvailable:")?));
    let groups = read("proc/self/cgroup").unwrap_or_default();
    let groups = groups.lines().flat_map(|line| in_groups(root, line));
    machine.into_iter().chain(groups).chain(in_address_space(root)).min()
}

/// Returns the number after a name at the start of a line.
fn entry(text: &str, name: &str) -> Option<u64> {
    text.lines().find_map(|line| line.strip_prefix(name)?.split_whitespace().next()?.parse().ok())
}

/// Returns what is left in the control group of a line of `/proc/self/cgroup`, and in each of its parents.
fn in_groups(root: &Path, line: &str) -> Vec<u64> {
    let mut fields = line.splitn(3, ':').skip(1);
    let (Some(controllers), Some(path)) = (fields.next(), fields.next()) else { return Vec::new() };
    let (mount, limit, usage, reclaimable) = match controllers {
        "" => ("sys/fs/cgroup", "memory.max", "memory.current", "inactive_file "),
        "memory" => ("sys/fs/cgroup/memory", "memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file "),
        _ => return Vec::new(),
    };
    let number = |group: &Path, name: &str| fs::read_to_string(group.join(name)).ok()?.trim().parse::<u64>().ok();
    let left = |group: PathBuf| {
        let cache = fs::read_to_string(group.join("memory.stat")).ok().and_then(|text| entry(&text, reclaimable));
        let used = number(&group, usage)?.saturating_sub(cache.unwrap_or(0));
        Some(number(&group, limit)?.saturating_sub(used))
    };
    let group = Path::new(path.trim_start_matches('/'));
    group.ancestors().filter_map(|group| left(root.join(mount).join(group))).collect()
}

/// Returns what the limit of the address space (`ulimit -v`) leaves.
fn in_address_space(root: &Path) -> Option<u64> {
    let limits = fs::read_to_string(root.join("proc/self/limits")).ok()?;
    let limit = entry(&limits, "Max address space")?;
    let status = fs::read_to_string(root.join("proc/self/status")).ok()?;
    Some(limit.saturating_sub(1024 * entry(&status, "VmSize:")?))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tree(files: &[(&str, &str)]) -> tempfile::TempDir {
        let root = tempfile::tempdir().unwrap();
        for (name, text) in files {
            let path = root.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        }
        root
    }

    #[test]
    fn the_tightest_limit_counts() {
        let machine = ("proc/meminfo", "MemTotal: 9000 kB\nMemAvailable:    8000 kB\n");
        let free = tree(&[machine, ("proc/self/limits", "Max address space         unlimited   unlimited  bytes\n")]);
        assert_eq!(available_memory(free.path()), Some(8_192_000));
        let parent = ("sys/fs/cgroup/box/memory.max", "5000000\n");
        let used = ("sys/fs/cgroup/box/memory.current", "1500000\n");
        let stat = ("sys/fs/cgroup/box/memory.stat", "anon 5\ninactive_file 500000\n");
        let inner = ("sys/fs/cgroup/box/job/memory.max", "max\n");
        let nested = tree(&[machine, ("proc/self/cgroup", "0::/box/job\n"), parent, used, stat, inner]);
        assert_eq!(available_memory(nested.path()), Some(4_000_000));
        let old = tree(&[
            machine,
            ("proc/self/cgroup", "9:name=systemd:/\n4:memory:/box\n"),
            ("sys/fs/cgroup/memory/box/memory.limit_in_bytes", "3000000\n"),
            ("sys/fs/cgroup/memory/box/memory.usage_in_bytes", "1000000\n"),
        ]);
        assert_eq!(available_memory(old.path()), Some(2_000_000));
        let limited = tree(&[
            machine,
            ("proc/self/limits", "Max address space         2048000              2048000              bytes\n"),
            ("proc/self/status", "VmSize:\t    1000 kB\n"),
        ]);
        assert_eq!(available_memory(limited.path()), Some(1_024_000));
        assert_eq!(available_memory(tree(&[]).path()), None);
    }
}
