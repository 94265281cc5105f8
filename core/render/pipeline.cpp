#include "core/render/pipeline.hpp"

#include "core/render/blocks_wave.hpp"

namespace isowave::core {

std::string_view to_string(PipelineKind kind) {
  return kind == PipelineKind::kBlocks ? "blocks" : "rays";
}

ocl::BufferSizes pipeline_sizes(PipelineKind kind, const Group::Limits &limits,
                                bool scanned_pairs) {
  return kind == PipelineKind::kBlocks ? BlocksWave::sizes(limits, scanned_pairs)
                                       : ocl::BufferSizes();
}

}  // namespace isowave::core
