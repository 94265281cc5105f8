// PNG pictures. Input: the file. One that is accepted reads the same when written again. Mutations
// change what is in a chunk, also behind its compression, and make its checksum right.

#include <random>
#include <vector>

#include "core/io/png.hpp"
#include "tests/fuzz/fuzz_target.hpp"

using namespace isowave::core;

namespace {

constexpr std::size_t kSignatureBytes = 8, kNumberBytes = 4, kTypeBytes = 4;
constexpr std::size_t kMaxUnpacked = 1u << 16;

struct Chunk {
  std::string type, data;
};

std::uint32_t number_at(std::string_view bytes, std::size_t at) {
  std::uint32_t number = 0;
  for (std::size_t i = 0; i < kNumberBytes; ++i)
    number = number << 8 | static_cast<unsigned char>(bytes[at + i]);
  return number;
}

std::string bytes_of_number(std::uint32_t number) {
  std::string bytes;
  for (int shift = 24; shift >= 0; shift -= 8) bytes += char(number >> shift & 0xff);
  return bytes;
}

/// As far as the file is made of chunks.
std::vector<Chunk> chunks_of(std::string_view file) {
  std::vector<Chunk> chunks;
  file.remove_prefix(std::min(kSignatureBytes, file.size()));
  while (file.size() >= kNumberBytes + kTypeBytes) {
    const std::size_t begin = kNumberBytes + kTypeBytes;
    const std::size_t length = std::min<std::size_t>(number_at(file, 0), file.size() - begin);
    chunks.push_back({std::string(file.substr(kNumberBytes, kTypeBytes)),
                      std::string(file.substr(begin, length))});
    file.remove_prefix(std::min(begin + length + kNumberBytes, file.size()));
  }
  return chunks;
}

std::string file_of(const std::vector<Chunk> &chunks) {
  std::string file = "\x89PNG\r\n\x1a\n";
  for (const Chunk &chunk : chunks) {
    const std::string body = chunk.type + chunk.data;
    file += bytes_of_number(std::uint32_t(chunk.data.size())) + body +
            bytes_of_number(fuzz::crc_of(body));
  }
  return file;
}

}  // namespace

std::size_t LLVMFuzzerCustomMutator(std::uint8_t *data, std::size_t size, std::size_t max_size,
                                    unsigned seed) {
  std::minstd_rand random(seed);
  std::vector<Chunk> chunks = chunks_of(fuzz::text_of(data, size));
  const auto dice = random() % 8;
  if (chunks.empty() || dice == 0) return LLVMFuzzerMutate(data, size, max_size);
  Chunk &chunk = chunks[random() % chunks.size()];
  if (dice == 1) {
    chunks.insert(chunks.begin() + std::ptrdiff_t(random() % chunks.size()), Chunk(chunk));
  } else if (dice == 2) {
    fuzz::mutate(chunk.type, kTypeBytes);
    chunk.type.resize(kTypeBytes, 'a');
  } else if (chunk.type == "IDAT" && dice > 4) {
    std::string rows = fuzz::unpack(chunk.data, kMaxUnpacked);
    fuzz::mutate(rows, kMaxUnpacked);
    chunk.data = fuzz::pack(rows, fuzz::Packing::kZlib);
  } else {
    fuzz::mutate(chunk.data, max_size);
  }
  return fuzz::replace(file_of(chunks), data, size, max_size);
}

int LLVMFuzzerTestOneInput(const std::uint8_t *data, std::size_t size) {
  const std::filesystem::path path = fuzz::put("picture.png", fuzz::text_of(data, size));
  Image8 image;
  if (!fuzz::accepts([&] { image = read_png(path); })) return 0;
  fuzz::demand((image.channels == 3 || image.channels == 4) &&
                   image.pixels.size() == std::size_t(image.width) * image.height * image.channels,
               "pixels are not width x height x 3 or 4");
  write_png(image, path);
  const Image8 again = read_png(path);
  fuzz::demand(again.width == image.width && again.height == image.height &&
                   again.channels == image.channels && again.pixels == image.pixels,
               "a picture is not the one that was written");
  return 0;
}
