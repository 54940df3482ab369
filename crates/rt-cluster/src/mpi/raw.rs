//! The calls of MPI that rsmpi has no safe form of: sending and receiving that are begun, looked after and left alone,
//! with errors returned instead of ending the process.
#![allow(unsafe_code, reason = "MPI is a C library; each call says why it is sound")]

use ::mpi::ffi;
use std::ffi::{c_char, c_int, c_void};
use std::mem;

/// Of all messages here, so that they meet nobody else's.
const TAG: c_int = 0x5242;

/// Bytes of a message that MPI has not finished with. They do not move, and are freed once it has.
struct Pending {
    bytes: Vec<u8>,
    request: ffi::MPI_Request,
    is_done: bool,
}

// SAFETY: a request is a handle, which MPI with `MPI_THREAD_SERIALIZED` takes from any thread, one at a time. `&mut`
// sees to that: all calls are made through the one `MpiRank` that shares the `World`.
unsafe impl Send for Pending {}

impl Pending {
    fn is_done(&mut self) -> Result<bool, String> {
        if self.is_done {
            return Ok(true);
        }
        let mut flag = 0;
        // SAFETY: the request was begun and has not been completed, its bytes are alive, and MPI is not left before the
        // `World` is, which outlives this.
        let code = unsafe { ffi::MPI_Test(&raw mut self.request, &raw mut flag, ffi::RSMPI_STATUS_IGNORE) };
        check(code)?;
        self.is_done = flag != 0;
        Ok(self.is_done)
    }
}

impl Drop for Pending {
    fn drop(&mut self) {
        if !self.is_done {
            // MPI may still read or write them, as those for a rank that died: they are never freed.
            mem::forget(mem::take(&mut self.bytes));
        }
    }
}

/// A message on its way out.
pub(super) struct Sending(Pending);

impl Sending {
    /// Begins to send; an error where the rank cannot be reached, `None` where the message is too long.
    pub(super) fn begin(to: u32, bytes: Vec<u8>) -> Option<Result<Self, String>> {
        let (length, to) = (c_int::try_from(bytes.len()).ok()?, c_int::try_from(to).ok()?);
        let mut request = null_request();
        // SAFETY: the bytes are as many, on the heap, and freed only once the request is done (see `Pending`).
        let code = unsafe {
            ffi::MPI_Isend(
                bytes.as_ptr().cast::<c_void>(),
                length,
                ffi::RSMPI_UINT8_T,
                to,
                TAG,
                ffi::RSMPI_COMM_WORLD,
                &raw mut request,
            )
        };
        let pending = Pending { bytes, request, is_done: false };
        // If it failed the bytes are not freed, which is safe whatever MPI makes of them.
        Some(check(code).map(|()| Self(pending)))
    }

    /// Whether it has left; an error where it never will.
    pub(super) fn is_done(&mut self) -> Result<bool, String> {
        self.0.is_done()
    }
}

/// A message on its way in.
pub(super) struct Receiving(Pending);

impl Receiving {
    /// Begins to receive the next message with its sender, if there is one.
    pub(super) fn begin() -> Option<(u32, Self)> {
        let (mut flag, mut length) = (0, 0);
        // SAFETY: both are plain data of C that MPI fills in; all zeros are valid for integers and pointers.
        let (mut message, mut status): (ffi::MPI_Message, ffi::MPI_Status) = unsafe { (mem::zeroed(), mem::zeroed()) };
        // SAFETY: all pointers are to variables of this function. A failed probe found nothing.
        unsafe {
            let code = ffi::MPI_Improbe(
                ffi::RSMPI_ANY_SOURCE,
                TAG,
                ffi::RSMPI_COMM_WORLD,
                &raw mut flag,
                &raw mut message,
                &raw mut status,
            );
            if code != 0 || flag == 0 || ffi::MPI_Get_count(&raw const status, ffi::RSMPI_UINT8_T, &raw mut length) != 0
            {
                return None;
            }
        }
        let mut bytes = vec![0; usize::try_from(length).ok()?];
        let mut request = null_request();
        // SAFETY: the message was matched by the probe and is received once; there is room for as many bytes as it has,
        // which are freed only once the request is done (see `Pending`).
        let code = unsafe {
            ffi::MPI_Imrecv(
                bytes.as_mut_ptr().cast::<c_void>(),
                length,
                ffi::RSMPI_UINT8_T,
                &raw mut message,
                &raw mut request,
            )
        };
        let pending = Pending { bytes, request, is_done: false };
        check(code).ok()?;
        Some((u32::try_from(status.MPI_SOURCE).ok()?, Self(pending)))
    }

    /// Whether it has come; an error where it never will.
    pub(super) fn is_done(&mut self) -> Result<bool, String> {
        self.0.is_done()
    }

    /// The bytes of a message that has come.
    pub(super) fn into_bytes(mut self) -> Vec<u8> {
        debug_assert!(self.0.is_done);
        mem::take(&mut self.0.bytes)
    }
}

fn null_request() -> ffi::MPI_Request {
    // SAFETY: a constant of the library.
    unsafe { ffi::RSMPI_REQUEST_NULL }
}

/// The number of this rank and how many there are; MPI is initialised.
pub(super) fn rank_and_size() -> [u32; 2] {
    let (mut rank, mut size) = (0, 1);
    // SAFETY: both pointers are to variables of this function.
    unsafe {
        ffi::MPI_Comm_rank(ffi::RSMPI_COMM_WORLD, &raw mut rank);
        ffi::MPI_Comm_size(ffi::RSMPI_COMM_WORLD, &raw mut size);
    }
    [rank, size].map(|number| u32::try_from(number).unwrap_or_default())
}

/// From now on calls return errors; MPI is initialised.
pub(super) fn return_errors() {
    // SAFETY: constants of the library. Should it fail, errors go on ending the process.
    unsafe { ffi::MPI_Comm_set_errhandler(ffi::RSMPI_COMM_WORLD, ffi::RSMPI_ERRORS_RETURN) };
}

/// What MPI says of an error.
fn check(code: c_int) -> Result<(), String> {
    if code == 0 {
        return Ok(());
    }
    // More than `MPI_MAX_ERROR_STRING` of any MPI: 256 or 512.
    let mut text = [0_u8; 4096];
    let mut length = 0;
    // SAFETY: there is room for any text.
    let known = unsafe { ffi::MPI_Error_string(code, text.as_mut_ptr().cast::<c_char>(), &raw mut length) };
    let length = usize::try_from(length).unwrap_or_default().min(text.len());
    let text = String::from_utf8_lossy(&text[..length]);
    Err(if known == 0 && length > 0 { text.into_owned() } else { format!("error {code} of MPI") })
}
