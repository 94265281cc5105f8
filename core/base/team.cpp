#include "core/base/team.hpp"

#include <algorithm>
#include <functional>
#include <new>
#include <stdexcept>

#include "core/base/error.hpp"

namespace isowave::core {

void Team::exchange(std::span<const Outgoing>, std::span<const Incoming>) {
  throw std::logic_error("this team has no messages");
}

void reduce_into(std::span<std::uint64_t> words, std::span<const std::uint64_t> others,
                 Reduction how) {
  const auto with = [&](const auto &of_two) {
    std::ranges::transform(words, others, words.begin(), of_two);
  };
  switch (how) {
    case Reduction::kMin:
      with([](std::uint64_t a, std::uint64_t b) { return std::min(a, b); });
      break;
    case Reduction::kMinOfHalves:
      with([](std::uint64_t a, std::uint64_t b) {
        const auto low = std::min(static_cast<std::uint32_t>(a), static_cast<std::uint32_t>(b));
        return std::min(a >> 32, b >> 32) << 32 | low;
      });
      break;
    case Reduction::kOr:
      with(std::bit_or<std::uint64_t>());
  }
}

bool may_change(std::span<const std::uint64_t> words, Reduction how) {
  std::uint64_t all = ~std::uint64_t{0}, any = 0;
  for (const std::uint64_t word : words) {
    all &= word;
    any |= word;
  }
  if (how == Reduction::kOr) return any != 0;
  const std::uint64_t nothing = how == Reduction::kMin ? 0xFFFFFFFF00000000u : 0xFF000000FF000000u;
  return (all & nothing) != nothing;
}

WordsInPlace in_place(std::span<std::uint64_t> words) {
  return {[words](std::size_t begin, std::span<std::uint64_t> part) {
            std::ranges::copy(words.subspan(begin, part.size()), part.begin());
          },
          [words](std::size_t begin, std::span<const std::uint64_t> part) {
            std::ranges::copy(part, words.subspan(begin).begin());
          }};
}

void reduce_in_pieces(std::size_t count, bool receives, const MakeWords &make,
                      const TakeWords &take,
                      const std::function<void(std::span<std::uint64_t> words)> &reduce_piece) {
  constexpr std::size_t kPieceWords = std::size_t{1} << 18;
  std::vector<std::uint64_t> buffer(std::min(count, kPieceWords));
  for (std::size_t begin = 0; begin < count; begin += kPieceWords) {
    const auto words = std::span(buffer).first(std::min(kPieceWords, count - begin));
    make(begin, words);
    reduce_piece(words);
    if (receives) take(begin, words);
  }
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
  if (team.size() == 1) return work();
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

void in_turns(Team &team, bool is_first, const std::function<void()> &work) {
  for (const bool turn_of_first : {true, false}) {
    together(team, [&] {
      if (is_first == turn_of_first) work();
    });
  }
}

bool any_of(Team &team, bool own) {
  const std::vector<std::string> all = team.all_gather(own ? "so" : "");
  return std::ranges::any_of(all, [](const std::string &each) { return !each.empty(); });
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
