//! Loading of a firmware file.

use std::{
    ffi::{CString, c_char},
    path::Path,
};

use crate::{HZ, sys};

/// Reads the firmware from an ELF file and sets chip and clock rate.
#[expect(unsafe_code, reason = "simavr is C")]
pub(crate) fn read(elf: &Path) -> Result<sys::elf_firmware_t, String> {
    let path = CString::new(elf.as_os_str().as_encoded_bytes()).map_err(|e| e.to_string())?;
    // SAFETY: the structure is plain data, for which zeros are valid; both pointers are valid
    // during the call.
    let mut firmware = unsafe {
        let mut firmware: sys::elf_firmware_t = std::mem::zeroed();
        if sys::elf_read_firmware(path.as_ptr(), &raw mut firmware) != 0 {
            return Err(format!("{} is not a firmware file", elf.display()));
        }
        firmware
    };
    for (slot, byte) in firmware.mmcu.iter_mut().zip(b"atmega328p\0") {
        *slot = *byte as c_char;
    }
    firmware.frequency = HZ as u32;
    Ok(firmware)
}
