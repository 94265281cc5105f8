// Requests and slots: block_cache.cl. key_bits 18 and 27 are the blocks of 256^3 and 2048^3 voxels;
// only their page table exists here.
//
//   request_cold  every block that the pairs' dual grids need is missing
//   request_warm  every one is cached
//   assign        slots for all of them, each taken from a block that was used in the pass before
//   classify      voxels inside of the cached blocks, for another isovalue
//   touched       cached blocks that the pass has used are counted
//   clear         every block is forgotten

#include <algorithm>
#include <utility>

#include "bench/block_pairs.hpp"
#include "core/stages/block_cache.hpp"

namespace isowave::core::bench {
namespace {

constexpr std::size_t kNumVisible = 1u << 14;

/// Two sets of pairs that fill the cache in turn.
class CacheInput {
 public:
  CacheInput(ocl::Device &device, std::uint64_t num_pairs, std::int64_t key_bits,
             Distribution distribution)
      : sets_{make_block_pairs(distribution, num_pairs, kNumVisible,
                               static_cast<std::uint32_t>(key_bits), 0),
              make_block_pairs(distribution, num_pairs, kNumVisible,
                               static_cast<std::uint32_t>(key_bits), 1)},
        rays_(device, {num_pairs}),
        cache_(device,
               BlockCache::limits_for(cube_params(static_cast<std::uint32_t>(key_bits)).grid,
                                      static_cast<std::uint32_t>(num_needed()), num_pairs),
               kGroupSize) {
    FrameParams params = cube_params(static_cast<std::uint32_t>(key_bits));
    params.schedule.cache_slots = cache_.num_slots;
    rays_.frame = params;
    for (int set = 0; set < 2; ++set) {
      open_pass(true);
      request();
      verify_requests();
      settle();
      verify_slots();
    }
    open_pass(false);
    request();
    check(rays_.counts.read()[0].requested_count == 0, "requests for cached blocks");
    settle();
  }

  std::size_t num_needed() const { return sets_[0].needed_block_ids.size(); }

  /// Starts a pass with the pairs of the pass before, or the other ones. Ends the last.
  void open_pass(bool other_pairs) {
    settle();
    if (other_pairs) turn_ = 1 - turn_;
    rays_.pair_block_ids.write(sets_[turn_].pair_block_ids);
    const PassCounts counts = pair_counts(rays_.num_rays, ++pass_);
    rays_.counts.write({&counts, 1});
  }
  void request() {
    cache_.request(rays_);
    requested_ = true;
  }
  void assign() {
    cache_.evict(rays_.counts, rays_);
    cache_.assign(rays_.counts, rays_);
    requested_ = false;
  }
  void classify() { cache_.classify(rays_); }
  void count_touched() { cache_.count_touched(rays_, true); }
  void clear() { cache_.clear(); }
  double num_slots() const { return cache_.num_slots; }
  /// Gives slots to requests that have none yet.
  void settle() {
    if (requested_) assign();
  }

 private:
  void verify_requests() {
    std::vector<uint> ids(rays_.counts.read()[0].requested_count);
    cache_.request_block_ids.read(ids);
    std::sort(ids.begin(), ids.end());
    check(ids == sets_[turn_].needed_block_ids, "list of missing blocks");
  }
  void verify_slots() {
    check(rays_.counts.read()[0].decoded_count == num_needed(), "number of blocks granted");
    std::vector<uint> ids = cache_.slot_block_ids.read();
    std::sort(ids.begin(), ids.end());
    check(ids == sets_[turn_].needed_block_ids, "blocks in the slots");
  }

  BlockPairs sets_[2];
  Wavefront rays_;
  BlockCache cache_;
  int turn_ = 0;
  std::uint32_t pass_ = 1;
  bool requested_ = false;
};

enum class Part { kRequestCold, kRequestWarm, kAssign, kClassify, kTouched, kClear };

void use_cache(benchmark::State &state, Part part, Distribution distribution) {
  const std::int64_t num_pairs = pixels_of_width(state.range(0));
  auto &in = input<CacheInput>(num_pairs, state.range(1), distribution);
  const auto pairs = static_cast<double>(num_pairs), needed = static_cast<double>(in.num_needed());
  if (part == Part::kAssign) {
    const auto prepare = [&] {
      in.open_pass(true);
      in.request();
    };
    // Read: stamps, requests, victims. Written: victims, both entries of the table, slot, stamp.
    measure(state, {needed, 32 * needed}, prepare, [&] { in.assign(); });
  } else if (part == Part::kClassify) {
    // Read: values, blocks of slots. Written: bits of voxels, changing cells.
    const double bytes = needed * double(slot_bytes(SlotType::kFloat32) + sizeof(uint) + 16);
    measure(
        state, {needed, bytes}, [] {}, [&] { in.classify(); });
  } else if (part == Part::kTouched) {
    measure(
        state, {needed, 8 * needed}, [] {}, [&] { in.count_touched(); });
  } else if (part == Part::kClear) {
    // Written: of each slot block, stamp, place in the list of free slots, a page and its count;
    // and the directory's words of what was cached.
    const auto fill = [&] {
      in.open_pass(true);
      in.request();
      in.settle();
    };
    measure(state, {needed, 4 * needed + 48 * in.num_slots()}, fill, [&] { in.clear(); });
  } else {
    const bool cold = part == Part::kRequestCold;
    measure(
        state, {pairs, 4 * pairs + 8 * needed}, [&] { in.open_pass(cold); }, [&] { in.request(); });
  }
  state.counters["blocks"] = needed;
}

/// One input serves all benchmarks: they are registered together.
void register_parts(Distribution distribution, std::int64_t width, std::int64_t key_bits) {
  for (const auto &[part, name] : {std::pair(Part::kRequestCold, "request_cold"),
                                   {Part::kRequestWarm, "request_warm"},
                                   {Part::kAssign, "assign"},
                                   {Part::kClassify, "classify"},
                                   {Part::kTouched, "touched"},
                                   {Part::kClear, "clear"}}) {
    const bool is_request = part == Part::kRequestCold || part == Part::kRequestWarm;
    if (!is_request && distribution == Distribution::kHot) continue;  // 8 blocks: launches, no work
    stage_benchmark(fmt::format("block_cache/{}/{}", name, to_string(distribution)),
                    [part = part, distribution](benchmark::State &state) {
                      use_cache(state, part, distribution);
                    })
        ->ArgNames({"width", "key_bits"})
        ->Args({width, key_bits});
  }
}

const bool kRegistered = [] {
  for (const Distribution distribution : kDistributions) {
    for (const std::int64_t width : kWidths) register_parts(distribution, width, 18);
    register_parts(distribution, kWidths.back(), 27);
  }
  return true;
}();

}  // namespace
}  // namespace isowave::core::bench
