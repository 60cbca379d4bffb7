// The end of a process that cannot go on: memory that Rust does not get, an exception where C++ allows none.
#include "cloudvdb/src/vdb/ffi.rs.h"

#include <csignal>
#include <optional>

#include <unistd.h>

namespace cloudvdb {

namespace {

std::optional<rust::Fn<void()>> last_call;

extern "C" void aborted(int) {
    (*last_call)();
    _exit(1);
}

} // namespace

void on_abort(rust::Fn<void()> last) {
    last_call.emplace(last);
    std::signal(SIGABRT, aborted);
}

} // namespace cloudvdb
