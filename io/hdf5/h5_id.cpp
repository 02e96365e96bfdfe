// SPDX-License-Identifier: Apache-2.0
// Every call of the library is noted while it lasts.
#include "io/hdf5/h5_id.hpp"

#include "io/hdf5/reading_note.hpp"

namespace tangere::h5 {

namespace {

thread_local int quiet_ones = 0;  // the library keeps its error output for each thread

}  // namespace

Quiet::Quiet() {
  note_call_begins();
  // Otherwise the library would try again, and complain, at the end of the program about a file
  // that a full disk kept it from closing. The call is refused without harm when the library is
  // already in use.
  static const herr_t no_exit_handler = H5dont_atexit();
  static_cast<void>(no_exit_handler);
  if (quiet_ones++ > 0) return;
  H5Eget_auto2(H5E_DEFAULT, &function_, &data_);
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
}

Quiet::~Quiet() {
  note_call_ends();
  if (--quiet_ones == 0) H5Eset_auto2(H5E_DEFAULT, function_, data_);
}

void Id::reset() noexcept {
  if (id_ < 0) return;
  const Quiet quiet;
  H5Idec_ref(id_);
  id_ = -1;
}

}  // namespace tangere::h5
