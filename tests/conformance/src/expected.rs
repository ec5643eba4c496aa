//! The table that every target must agree with.

use crate::how::Format;

/// `crc32.txt`: a head that names the columns, then a row for each case.
pub const TABLE: &str = include_str!("../crc32.txt");

/// The CRC32 that the frame of a case has; `None` where the table does not say.
pub fn crc32(case: &str, format: Format) -> Option<u32> {
    let rows = || TABLE.lines().filter(|line| !line.starts_with('#'));
    let column = rows().next()?.split_ascii_whitespace().position(|c| c == format.name())?;
    let mut row = rows()
        .map(str::split_ascii_whitespace)
        .find(|row| row.clone().next().is_some_and(|name| name == case))?;
    u32::from_str_radix(row.nth(column)?, 16).ok()
}
