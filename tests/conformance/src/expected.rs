//! The table that every target must agree with.

/// `crc32.txt`: a head that names the columns, then a row for each case.
pub const TABLE: &str = include_str!("../crc32.txt");

/// The CRC32 in a column of a case; `None` where the table does not say.
///
/// Goes by bytes: the standard library's lines and words bring panic paths, of which a program that
/// links this shall have none.
pub fn crc32(case: &str, column: &str) -> Option<u32> {
    let rows =
        || TABLE.as_bytes().split(|&byte| byte == b'\n').filter(|row| !row.starts_with(b"#"));
    let column = words(rows().next()?).position(|word| word == column.as_bytes())?;
    let row = rows().find(|row| words(row).next() == Some(case.as_bytes()))?;
    number(words(row).nth(column)?)
}

/// What blanks separate.
fn words(row: &[u8]) -> impl Iterator<Item = &[u8]> {
    row.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
}

/// Eight lower-case hexadecimal digits.
fn number(word: &[u8]) -> Option<u32> {
    if word.len() != 8 {
        return None;
    }
    word.iter().try_fold(0, |number, &byte| {
        let digit = match byte {
            b'0'..=b'9' => byte - b'0',
            b'a'..=b'f' => byte - b'a' + 10,
            _ => return None,
        };
        Some(number << 4 | u32::from(digit))
    })
}
