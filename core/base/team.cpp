#include "core/base/team.hpp"

#include <algorithm>
#include <new>
#include <stdexcept>

#include "core/base/error.hpp"

namespace isowave::core {

void Team::exchange(std::span<const Outgoing>, std::span<const Incoming>) {
  throw std::logic_error("this team has no messages");
}

void agree_on_error(Team &team, const std::string &error) {
  const std::vector<std::string> errors = team.all_gather(error);
  const auto first =
      std::ranges::find_if(errors, [](const std::string &each) { return !each.empty(); });
  if (first == errors.end()) return;
  if (std::ranges::all_of(errors, [&](const std::string &each) { return each == *first; }))
    throw Error("{}", *first);
  throw Error("rank {}: {}", first - errors.begin(), *first);
}

void together(Team &team, const std::function<void()> &work) {
  std::string error;
  try {
    work();
  } catch (const std::bad_alloc &) {
    error = "out of memory";
  } catch (const std::exception &failure) {
    error = failure.what();
    if (error.empty()) error = "failed";
  }
  agree_on_error(team, error);
}

void agree_on(Team &team, const std::string &what, const std::string &text) {
  const std::vector<std::string> texts = team.all_gather(text);
  const auto other =
      std::ranges::find_if(texts, [&](const std::string &each) { return each != texts.front(); });
  if (other == texts.end()) return;
  throw Error("rank {} has another {} than rank 0: start all ranks alike", other - texts.begin(),
              what);
}

}  // namespace isowave::core
