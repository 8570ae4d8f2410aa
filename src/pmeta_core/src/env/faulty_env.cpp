#include "pmeta_core/env/faulty_env.h"

#include <new>

#include "pmeta_core/base/format.h"
#include "pmeta_core/base/process.h"
#include "pmeta_core/env/env.h"

namespace pmeta {
namespace {

constexpr std::size_t kLongestReason = 300;

}  // namespace

void rethrowFault(const std::string& failed, bool foreign) {
  std::string reason = "it threw something that is no std::exception";
  try {
    throw;
  } catch (const BrokenEpisode&) {
    throw;
  } catch (const FaultyEnv&) {
    throw;
  } catch (const Interrupted&) {
    throw;
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::length_error& error) {
    if (!foreign) throw;
    reason = error.what();
  } catch (const Error& error) {
    if (!foreign) throw;
    reason = error.what();
  } catch (const std::exception& error) {
    reason = error.what();
  } catch (...) {
  }
  reason = plain(reason, kLongestReason);
  if (!reason.empty() && reason.back() == '.') reason.pop_back();
  throw FaultyEnv(failed + ": " + reason + ".");
}

}  // namespace pmeta
