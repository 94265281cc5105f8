#include "core/zfp/team_list.hpp"

#include <algorithm>
#include <exception>
#include <optional>
#include <vector>

#include "core/zfp/zfp_file.hpp"

namespace isowave::core {

std::uint64_t write_deflated(Team &team, SectionWriter &out, std::span<const Stretch> stretches,
                             std::span<const std::span<const std::byte>> own,
                             std::size_t piece_size) {
  const bool is_first = team.rank() == 0;
  const std::uint64_t begin = out.section().bytes, total = stretches.back().end;
  together(team, [&] {
    std::exception_ptr failure;
    std::optional<Deflater> deflater;
    std::vector<std::byte> piece(is_first ? piece_size : 0);
    // Others send what they have, whatever fails here.
    const auto attempt = [&](const auto &work) {
      if (failure) return;
      try {
        work();
      } catch (...) {
        failure = std::current_exception();
      }
    };
    if (is_first) {
      attempt(
          [&] { deflater.emplace([&](std::span<const std::byte> bytes) { out.write(bytes); }); });
    }
    for (std::uint64_t at = 0; at < total; at += piece_size) {
      const std::uint64_t end = std::min(at + piece_size, total);
      std::vector<Incoming> received;
      auto next_own = own.begin();
      for (const Stretch &stretch : stretches) {
        const bool is_own = stretch.rank == team.rank();
        const std::span<const std::byte> bytes =
            is_own ? *next_own++ : std::span<const std::byte>();
        const std::uint64_t from = std::max(at, stretch.begin), to = std::min(end, stretch.end);
        if (from >= to) continue;
        if (is_own) {
          const std::span<const std::byte> some = bytes.subspan(from - stretch.begin, to - from);
          if (is_first) {
            std::ranges::copy(some, piece.begin() + std::ptrdiff_t(from - at));
          } else {
            const Outgoing sent{0, some};
            team.exchange({&sent, 1}, {});
          }
        } else if (is_first) {
          received.push_back({stretch.rank, std::span(piece).subspan(from - at, to - from)});
        }
      }
      if (!is_first) continue;
      team.exchange({}, received);
      attempt([&] { deflater->add(std::span(piece).first(end - at)); });
    }
    if (is_first) attempt([&] { deflater->finish(); });
    if (failure) std::rethrow_exception(failure);
  });
  return out.section().bytes - begin;
}

}  // namespace isowave::core
