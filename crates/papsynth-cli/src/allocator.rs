//! The allocator of the C library, told when to give memory back to the system.

/// Keeps what a long run holds from growing with its length. By itself glibc keeps twice as much freed memory in the heap of every thread as
/// the largest block had that was ever given back (mallopt(3)), so that each object larger than all before raises it. With fixed numbers a
/// run of small images holds a third less, and takes a twentieth longer; of larger images neither differs.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
#[allow(unsafe_code, reason = "there is no other way to tell it")]
pub(crate) fn settle() {
    /// Larger blocks are the system's own.
    const OWN: libc::c_int = 4 << 20;
    /// Freed memory at the end of a heap that is kept.
    const KEPT: libc::c_int = 2 << 20;
    // SAFETY: both calls set a number of the allocator. They take any value, and what they refuse stays as it was.
    unsafe {
        libc::mallopt(libc::M_MMAP_THRESHOLD, OWN);
        libc::mallopt(libc::M_TRIM_THRESHOLD, KEPT);
    }
}

/// Other allocators are left as they are.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
pub(crate) fn settle() {}
