#pragma once
// The processes that work on a volume together, and what they say to each other. tools/isowave has
// those of MPI; the library itself needs none.

#include <cstdint>
#include <cstring>
#include <functional>
#include <span>
#include <string>
#include <vector>

namespace isowave::core {

/// Bytes that go to another process, or come from it.
template <class Byte>
struct Message {
  std::uint32_t rank;
  std::span<Byte> bytes;
};
using Outgoing = Message<const std::byte>;
using Incoming = Message<std::byte>;

/// Words of one place that give nothing are the same at all processes. So processes need not send
/// them.
enum class Reduction {
  kMin,          ///< the smallest word; a word gives nothing if its upper 32 bits are ones
  kMinOfHalves,  ///< the smallest upper 32 bits, and the smallest lower ones; 32 bits give nothing
                 ///< if the upper 8 of them are ones
  kOr            ///< the bits of all; 0 gives nothing
};
enum class Receiver { kRank0, kAll };

/// Makes words of `words`, each with that of others at its place.
void reduce_into(std::span<std::uint64_t> words, std::span<const std::uint64_t> others,
                 Reduction how);

/// Whether words may change the outcome of a reduction: if they cannot, all give nothing.
bool may_change(std::span<const std::uint64_t> words, Reduction how);

/// One process's part in a reduction: it gives its words from `begin` on. Called for parts, in any
/// order, and from several threads.
using MakeWords = std::function<void(std::size_t begin, std::span<std::uint64_t> words)>;
/// Takes the outcome of the words from `begin` on. Called likewise.
using TakeWords = std::function<void(std::size_t begin, std::span<const std::uint64_t> words)>;

/// A part in a reduction of words in memory. The receiver's words become the outcome.
struct WordsInPlace {
  MakeWords make;
  TakeWords take;
};
WordsInPlace in_place(std::span<std::uint64_t> words);

/// Processes that work together. All of them make the same calls in the same order.
class Team {
 public:
  virtual ~Team() = default;
  virtual std::uint32_t rank() const = 0;  ///< of this process, 0 to size() - 1
  virtual std::uint32_t size() const = 0;
  /// The texts of all processes, by rank.
  virtual std::vector<std::string> all_gather(const std::string &text) = 0;
  /// Reduces the words of all processes to one word at each of `count` places. Receivers of the
  /// outcome call `take`.
  virtual void reduce(std::size_t count, Reduction how, Receiver who, const MakeWords &make,
                      const TakeWords &take) = 0;
  /// Bytes of words that this process has given to others in reductions, so far; 0 if that is not
  /// counted.
  virtual std::uint64_t given_bytes() const { return 0; }
  /// Sends and receives, in order, and returns when both are done; never from or to this process.
  /// Only the named processes call it. Drawing does not need it.
  virtual void exchange(std::span<const Outgoing> sent, std::span<const Incoming> received);
};

/// A reduction for teams that reduce words in place: reduce_piece() is called for each piece.
void reduce_in_pieces(std::size_t count, bool receives, const MakeWords &make,
                      const TakeWords &take,
                      const std::function<void(std::span<std::uint64_t> words)> &reduce_piece);

/// The team of a process that works alone.
class TeamOfOne : public Team {
 public:
  std::uint32_t rank() const override { return 0; }
  std::uint32_t size() const override { return 1; }
  std::vector<std::string> all_gather(const std::string &text) override { return {text}; }
  void reduce(std::size_t count, Reduction, Receiver, const MakeWords &make,
              const TakeWords &take) override {
    reduce_in_pieces(count, true, make, take, [](std::span<std::uint64_t>) {});
  }
};

/// Throws Error at every rank if a rank gives a text: the text of the first such rank, with its
/// number unless all ranks give the same text.
void agree_on_error(Team &team, const std::string &error);

/// Does each rank's own work. If a rank fails, all ranks throw its error, so that none waits for
/// it.
void together(Team &team, const std::function<void()> &work);

/// The same, but ranks that are not first begin when those that are have ended. A driver keeps
/// kernels that one process has compiled, so the others need not compile them again.
void in_turns(Team &team, bool is_first, const std::function<void()> &work);

/// Whether any rank says so, at all ranks.
bool any_of(Team &team, bool own);

/// Throws Error at every rank unless all have the same text; the error names a rank that differs.
///
/// what  names the text
void agree_on(Team &team, const std::string &what, const std::string &text);

/// All ranks' values, by rank.
template <class Value>
std::vector<Value> gather(Team &team, const std::vector<Value> &values) {
  std::string own(values.size() * sizeof(Value), '\0');
  if (!values.empty()) std::memcpy(own.data(), values.data(), own.size());
  std::vector<Value> all;
  for (const std::string &each : team.all_gather(own)) {
    if (each.empty()) continue;
    const std::size_t before = all.size();
    all.resize(before + each.size() / sizeof(Value));
    std::memcpy(all.data() + before, each.data(), each.size());
  }
  return all;
}

/// Rank 0's values, at all ranks.
template <class Value>
std::vector<Value> of_first(Team &team, const std::vector<Value> &values) {
  return gather(team, team.rank() == 0 ? values : std::vector<Value>());
}

}  // namespace isowave::core
