//! What the operating system says about memory. Linux says it in files; on other systems nothing is known.
//!
//! | limit | left of it |
//! | --- | --- |
//! | the machine | `MemAvailable` and the free swap of `/proc/meminfo` |
//! | control groups, of the process and above it | the limit, less what is used, not counting cached files |
//! | `ulimit -v`, `ulimit -d` | the limit, less `VmSize` or `VmData` |

use std::fs;
use std::path::Path;

use super::Left;

/// The smallest amount that any limit leaves.
pub(super) fn left() -> Option<Left> {
    let [groups, limits, status] =
        ["cgroup", "limits", "status"].map(|file| text(Path::new("/proc/self").join(file)));
    let limits = [
        machine(),
        control_groups(&groups.unwrap_or_default(), Path::new("/sys/fs/cgroup")),
        resource_limits(&limits.unwrap_or_default(), &status.unwrap_or_default()),
    ];
    limits.into_iter().flatten().min_by_key(|left| left.bytes)
}

/// How much memory the process uses now, in bytes.
pub(super) fn resident() -> Option<u64> {
    kibibytes(&text("/proc/self/status")?, "VmRSS")
}

/// The most memory that the process has used, in bytes.
pub(crate) fn peak() -> Option<u64> {
    kibibytes(&text("/proc/self/status")?, "VmHWM")
}

/// Resets [`peak`], if the system can do that.
pub(crate) fn forget_peak() {
    let _ = fs::write("/proc/self/clear_refs", "5");
}

fn text(path: impl AsRef<Path>) -> Option<String> {
    fs::read_to_string(path).ok()
}

/// The bytes of a line `name: 12 kB`.
fn kibibytes(text: &str, name: &str) -> Option<u64> {
    let mut lines = text.lines().filter_map(|line| line.split_once(':'));
    let (_, value) = lines.find(|(key, _)| key.trim() == name)?;
    let number: u64 = value.split_whitespace().next()?.parse().ok()?;
    Some(1024 * number)
}

fn machine() -> Option<Left> {
    let text = text("/proc/meminfo")?;
    let available = kibibytes(&text, "MemAvailable")?;
    Some(Left {
        bytes: available + kibibytes(&text, "SwapFree").unwrap_or(0),
        of: "the machine's memory",
    })
}

/// What is left by the control groups that `/proc/self/cgroup` lists, and by those above them; `root` is where
/// they are mounted. In a container the listed names may be those outside the container; then the limit of the
/// container is that of the root.
fn control_groups(listed: &str, root: &Path) -> Option<Left> {
    let mut least = None;
    for line in listed.lines() {
        let mut fields = line.splitn(3, ':').skip(1);
        let (Some(controllers), Some(name)) = (fields.next(), fields.next()) else {
            continue;
        };
        let (root, files) = if controllers.is_empty() {
            (root.to_path_buf(), ["memory.max", "memory.current"])
        } else if controllers.split(',').any(|one| one == "memory") {
            let files = ["memory.limit_in_bytes", "memory.usage_in_bytes"];
            (root.join("memory"), files)
        } else {
            continue;
        };
        for group in Path::new(name.trim_start_matches('/')).ancestors() {
            let folder = root.join(group);
            let number = |file: &str| text(folder.join(file))?.trim().parse::<u64>().ok();
            if let (Some(limit), Some(used)) = (number(files[0]), number(files[1])) {
                let cached = text(folder.join("memory.stat")).map_or(0, |stat| cached(&stat));
                let left = limit.saturating_sub(used.saturating_sub(cached));
                least = Some(least.map_or(left, |least: u64| least.min(left)));
            }
        }
    }
    least.map(|bytes| Left {
        bytes,
        of: "the memory of this control group",
    })
}

/// Bytes of cached files, which the system gives up if memory is needed.
fn cached(stat: &str) -> u64 {
    let count = |names: [&str; 2]| -> u64 {
        let of_names = stat.lines().filter_map(|line| {
            let (name, value) = line.split_once(' ')?;
            names
                .contains(&name)
                .then(|| value.trim().parse::<u64>().ok())?
        });
        of_names.sum()
    };
    // In the first version of control groups, the totals include the groups below.
    match count(["total_inactive_file", "total_active_file"]) {
        0 => count(["inactive_file", "active_file"]),
        total => total,
    }
}

fn resource_limits(limits: &str, status: &str) -> Option<Left> {
    let left = |limit: &str, used: &str, of: &'static str| {
        let line = limits.lines().find_map(|line| line.strip_prefix(limit))?;
        let most: u64 = line.split_whitespace().next()?.parse().ok()?;
        let bytes = most.saturating_sub(kibibytes(status, used)?);
        Some(Left { bytes, of })
    };
    [
        left("Max address space", "VmSize", "the limit of `ulimit -v`"),
        left("Max data size", "VmData", "the limit of `ulimit -d`"),
    ]
    .into_iter()
    .flatten()
    .min_by_key(|left| left.bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_of_the_process_leave_what_it_does_not_use() {
        let limits = "Limit                     Soft Limit           Hard Limit           Units     \n\
             Max data size             unlimited            unlimited            bytes     \n\
             Max address space         1048576000           unlimited            bytes     \n";
        let status = "VmPeak:\t  900000 kB\nVmSize:\t  500000 kB\nVmData:\t  100000 kB\n";
        let left = resource_limits(limits, status).expect("there is one");
        assert_eq!(left.bytes, 1_048_576_000 - 512_000_000);
        assert!(left.of.contains("ulimit -v"));
        let unlimited = limits.replace("1048576000", "unlimited ");
        assert_eq!(resource_limits(&unlimited, status), None);
    }

    #[test]
    fn groups_above_count_and_cached_files_do_not() {
        let root = tempfile::tempdir().expect("a temporary folder");
        let group = |name: &str, files: &[(&str, &str)]| {
            let folder = root.path().join(name);
            fs::create_dir_all(&folder).expect("writable");
            for (file, text) in files {
                fs::write(folder.join(file), text).expect("writable");
            }
        };
        group(
            "a",
            &[("memory.max", "1000\n"), ("memory.current", "900\n")],
        );
        group(
            "a",
            &[("memory.stat", "anon 1\ninactive_file 300\nactive_file 50\n")],
        );
        group(
            "a/b",
            &[("memory.max", "max\n"), ("memory.current", "10\n")],
        );
        let left = |listed| control_groups(listed, root.path()).map(|left| left.bytes);
        assert_eq!(left("0::/a/b\n"), Some(450));
        assert_eq!(left("0::/elsewhere\n"), None);
        let first = [
            ("memory.limit_in_bytes", "800"),
            ("memory.usage_in_bytes", "700"),
            ("memory.stat", "inactive_file 1\ntotal_inactive_file 100\n"),
        ];
        group("memory/c", &first);
        assert_eq!(left("5:cpu,memory:/c\n3:pids:/a\n"), Some(200));
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn this_machine_tells() {
        let left = left().expect("Linux tells");
        assert!(left.bytes > 1 << 20, "{left:?}");
        assert!(resident() <= peak());
    }
}
