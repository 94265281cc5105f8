#include "core/view/color_maps.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "core/base/error.hpp"

namespace isowave::core {

namespace {

// Colours as RRGGBB, from low to high. viridis, magma: S. van der Walt and N. Smith, 2015 (CC0).
// cividis: J. R. Nunez, C. R. Anderton and R. S. Renslow, PLOS ONE 13, 2018 (CC0). coolwarm:
// computed by the formulas of K. Moreland, Diverging Color Maps for Scientific Visualization, ISVC
// 2009, from (59, 76, 192) to (180, 4, 38).
constexpr std::string_view kViridis =
    "44015444025645045745055946075a46085c460a5d460b5e470d60470e61471063471164471365481467"
    "48166848176948186a481a6c481b6d481c6e481d6f481f70482071482173482374482475482576482677"
    "482878482979472a7a472c7a472d7b472e7c472f7d46307e46327e46337f463480453581453781453882"
    "443983443a83443b84433d84433e85423f854240864241864142874144874045884046883f47883f4889"
    "3e49893e4a893e4c8a3d4d8a3d4e8a3c4f8a3c508b3b518b3b528b3a538b3a548c39558c39568c38588c"
    "38598c375a8c375b8d365c8d365d8d355e8d355f8d34608d34618d33628d33638d32648e32658e31668e"
    "31678e31688e30698e306a8e2f6b8e2f6c8e2e6d8e2e6e8e2e6f8e2d708e2d718e2c718e2c728e2c738e"
    "2b748e2b758e2a768e2a778e2a788e29798e297a8e297b8e287c8e287d8e277e8e277f8e27808e26818e"
    "26828e26828e25838e25848e25858e24868e24878e23888e23898e238a8d228b8d228c8d228d8d218e8d"
    "218f8d21908d21918c20928c20928c20938c1f948c1f958b1f968b1f978b1f988b1f998a1f9a8a1e9b8a"
    "1e9c891e9d891f9e891f9f881fa0881fa1881fa1871fa28720a38620a48621a58521a68522a78522a884"
    "23a98324aa8325ab8225ac8226ad8127ad8128ae8029af7f2ab07f2cb17e2db27d2eb37c2fb47c31b57b"
    "32b67a34b67935b77937b87838b9773aba763bbb753dbc743fbc7340bd7242be7144bf7046c06f48c16e"
    "4ac16d4cc26c4ec36b50c46a52c56954c56856c66758c7655ac8645cc8635ec96260ca6063cb5f65cb5e"
    "67cc5c69cd5b6ccd5a6ece5870cf5773d05675d05477d1537ad1517cd2507fd34e81d34d84d44b86d549"
    "89d5488bd6468ed64590d74393d74195d84098d83e9bd93c9dd93ba0da39a2da37a5db36a8db34aadc32"
    "addc30b0dd2fb2dd2db5de2bb8de29bade28bddf26c0df25c2df23c5e021c8e020cae11fcde11dd0e11c"
    "d2e21bd5e21ad8e219dae319dde318dfe318e2e418e5e419e7e419eae51aece51befe51cf1e51df4e61e"
    "f6e620f8e621fbe723fde725";

constexpr std::string_view kMagma =
    "00000401000501010601010802010902020b02020d03030f03031204041405041606051806051a07061c"
    "08071e0907200a08220b09240c09260d0a290e0b2b100b2d110c2f120d31130d34140e36150e38160f3b"
    "180f3d19103f1a10421c10441d11471e114920114b21114e22115024125325125527125829115a2a115c"
    "2c115f2d11612f116331116533106734106936106b38106c390f6e3b0f703d0f713f0f72400f74420f75"
    "440f764510774710784910784a10794c117a4e117b4f127b51127c52137c54137d56147d57157e59157e"
    "5a167e5c167f5d177f5f187f601880621980641a80651a80671b80681c816a1c816b1d816d1d816e1e81"
    "701f81721f817320817521817621817822817922827b23827c23827e2482802582812581832681842681"
    "8627818827818928818b29818c29818e2a81902a81912b81932b80942c80962c80982d80992d809b2e7f"
    "9c2e7f9e2f7fa02f7fa1307ea3307ea5317ea6317da8327daa337dab337cad347cae347bb0357bb2357b"
    "b3367ab5367ab73779b83779ba3878bc3978bd3977bf3a77c03a76c23b75c43c75c53c74c73d73c83e73"
    "ca3e72cc3f71cd4071cf4070d0416fd2426fd3436ed5446dd6456cd8456cd9466bdb476adc4869de4968"
    "df4a68e04c67e24d66e34e65e44f64e55064e75263e85362e95462ea5661eb5760ec5860ed5a5fee5b5e"
    "ef5d5ef05f5ef1605df2625df2645cf3655cf4675cf4695cf56b5cf66c5cf66e5cf7705cf7725cf8745c"
    "f8765cf9785df9795df97b5dfa7d5efa7f5efa815ffb835ffb8560fb8761fc8961fc8a62fc8c63fc8e64"
    "fc9065fd9266fd9467fd9668fd9869fd9a6afd9b6bfe9d6cfe9f6dfea16efea36ffea571fea772fea973"
    "feaa74feac76feae77feb078feb27afeb47bfeb67cfeb77efeb97ffebb81febd82febf84fec185fec287"
    "fec488fec68afec88cfeca8dfecc8ffecd90fecf92fed194fed395fed597fed799fed89afdda9cfddc9e"
    "fddea0fde0a1fde2a3fde3a5fde5a7fde7a9fde9aafdebacfcecaefceeb0fcf0b2fcf2b4fcf4b6fcf6b8"
    "fcf7b9fcf9bbfcfbbdfcfdbf";

constexpr std::string_view kCividis =
    "00224e00234f00245100255300255400265600275800285900285b00295d002a5f002a61002b62002c64"
    "002c66002d68002e6a002e6c002f6d00306f0030700031700031710132710533710833700c34700f3570"
    "12357014367016377018376f1a386f1c396f1e3a6f203a6f213b6e233c6e243c6e263d6e273e6e293f6e"
    "2a3f6d2b406d2d416d2e416d2f426d31436d32436d33446d34456c35456c36466c38476c39486c3a486c"
    "3b496c3c4a6c3d4a6c3e4b6c3f4c6c404c6c414d6c424e6c434e6c444f6c45506c46516c47516c48526c"
    "49536c4a536c4b546c4c556c4d556c4e566c4f576c50576c51586d52596d535a6d545a6d555b6d555c6d"
    "565c6d575d6d585e6d595e6e5a5f6e5b606e5c616e5d616e5e626e5e636f5f636f60646f61656f62656f"
    "636670646770656870656870666970676a71686a71696b716a6c716b6d726c6d726c6e726d6f726e6f73"
    "6f70737071737172747272747273747374757474757575757676767777767777777878777979777a7a78"
    "7b7a787c7b787d7c787e7c787e7d787f7e78807f78817f78828079838179848279858279868379878478"
    "8885788985788a86788b87788c88788d88788e89788f8a78908b78918b78928c78928d78938e78948e77"
    "958f779690779791779892779992779a93769b94769c95769d95769e96769f9775a09875a19975a29975"
    "a39a74a49b74a59c74a69c74a79d73a89e73a99f73aaa073aba072aca172ada272aea371afa471b0a571"
    "b1a570b3a670b4a76fb5a86fb6a96fb7a96eb8aa6eb9ab6dbaac6dbbad6dbcae6cbdae6cbeaf6bbfb06b"
    "c0b16ac1b26ac2b369c3b369c4b468c5b568c6b667c7b767c8b866c9b965cbb965ccba64cdbb63cebc63"
    "cfbd62d0be62d1bf61d2c060d3c05fd4c15fd5c25ed6c35dd7c45cd9c55cdac65bdbc75adcc859ddc858"
    "dec958dfca57e0cb56e1cc55e2cd54e4ce53e5cf52e6d051e7d150e8d24fe9d34eead34cebd44bedd54a"
    "eed649efd748f0d846f1d945f2da44f3db42f5dc41f6dd3ff7de3ef8df3cf9e03afbe138fce236fde334"
    "fee434fee535fee636fee838";

constexpr std::string_view kCoolwarm =
    "3b4cc03c4ec23d50c33e51c54053c64155c84256c94358cb445acc455cce475dcf485fd14961d24a63d3"
    "4b64d54d66d64e68d74f69d9506bda526ddb536edd5470de5572df5773e05875e15977e25a78e45c7ae5"
    "5d7ce65e7de75f7fe86180e96282ea6384eb6585ec6687ed6788ee698aef6a8bef6b8df06d8ef16e90f2"
    "6f91f37193f37294f47396f57597f67699f6779af7799cf87a9df87b9ff97da0f97ea1fa80a3fa81a4fb"
    "82a6fb84a7fc85a8fc87aafc88abfd89acfd8badfd8caffe8db0fe8fb1fe90b2fe92b4fe93b5ff94b6ff"
    "96b7ff97b8ff98b9ff9abbff9bbcff9dbdff9ebeff9fbfffa1c0ffa2c1ffa3c2fea5c3fea6c4fea8c5fe"
    "a9c6feaac7fdacc8fdadc9fdaec9fcb0cafcb1cbfcb2ccfbb3cdfbb5cefab6cefab7cff9b9d0f9bad1f8"
    "bbd1f8bcd2f7bed3f6bfd3f6c0d4f5c1d4f4c3d5f4c4d6f3c5d6f2c6d7f1c8d7f1c9d8f0cad8efcbd8ee"
    "ccd9edcdd9eccedaebd0daead1dae9d2dbe8d3dbe7d4dbe6d5dbe5d6dce4d7dce3d8dce2d9dce1dadce0"
    "dbdddedcdddddddcdcdedcdbdfdcd9e1dbd8e2dad6e3dad5e4d9d3e5d9d2e5d8d1e6d8cfe7d7cee8d6cc"
    "e9d6cbead5c9ebd4c8ebd3c6ecd3c5edd2c3eed1c2eed0c0efcfbfefcebdf0cebcf1cdbaf1ccb8f2cbb7"
    "f2cab5f3c9b4f3c8b2f4c7b1f4c6aff4c5aef5c4acf5c3aaf5c1a9f6c0a7f6bfa6f6bea4f6bda2f7bca1"
    "f7ba9ff7b99ef7b89cf7b79bf7b599f7b497f7b396f7b294f7b093f7af91f7ad90f7ac8ef7ab8cf7a98b"
    "f7a889f7a688f6a586f6a385f6a283f6a081f59f80f59d7ef59c7df49a7bf4997af49778f39577f39475"
    "f29274f29072f18f71f18d6ff08b6ef08a6cef886bef8669ee8568ed8366ed8165ec7f63eb7d62ea7c60"
    "ea7a5fe9785de8765ce7745ae67259e57058e56f56e46d55e36b53e26952e16751e0654fdf634ede614d"
    "dd5f4bdc5d4adb5b49da5947d85646d75445d65243d55042d44e41d34c40d1493ed0473dcf453cce433b"
    "cc4039cb3e38ca3b37c83936c73634c63433c43132c32e31c12b30c0282fbf252ebd222cbc1e2bba1a2a"
    "b91629b71128b60b27b40426";

constexpr std::string_view kNames[] = {"viridis", "magma", "cividis", "coolwarm", "gray", "labels"};
constexpr std::string_view kTables[] = {kViridis, kMagma, kCividis, kCoolwarm};

/// Colours for labels: hues by the golden ratio, so that any few in a row are far apart, in turns
/// light and dark, full and pale.
std::uint32_t label_color(std::uint32_t label) {
  constexpr double kGoldenRatio = 0.6180339887498949;
  constexpr double kValues[] = {0.92, 0.72, 0.85}, kSaturations[] = {0.6, 0.75, 0.45};
  const double hue = 6 * (label * kGoldenRatio - static_cast<std::uint32_t>(label * kGoldenRatio));
  const double value = kValues[label % 3], saturation = kSaturations[label / 3 % 3];
  std::uint32_t color = 0;
  for (std::uint32_t channel = 0; channel < 3; ++channel) {
    // Full at its own hue and a sixth of the circle around it, and none half a circle away.
    const double turn = std::fmod(hue + 6 - 2 * channel, 6);
    const double share = std::clamp(2 - std::min(turn, 6 - turn), 0.0, 1.0);
    const double light = value * (1 - saturation * (1 - share));
    color |= static_cast<std::uint32_t>(std::lround(255 * light)) << 8 * channel;
  }
  return color;
}

std::uint32_t digit(char c) {
  return static_cast<std::uint32_t>(c <= '9' ? c - '0' : c - 'a' + 10);
}

}  // namespace

std::span<const std::string_view> color_map_names() {
  return kNames;
}

std::array<std::uint32_t, 256> color_map(std::string_view name) {
  const auto found = std::ranges::find(kNames, name);
  if (found == std::end(kNames))
    throw Error("there is no colour map '{}': {}", name, fmt::join(kNames, ", "));
  const auto number = static_cast<std::size_t>(found - std::begin(kNames));
  std::array<std::uint32_t, 256> colors{};
  for (std::uint32_t i = 0; i < colors.size(); ++i) {
    if (name == "labels") {
      colors[i] = label_color(i);
      continue;
    }
    if (name == "gray") {
      colors[i] = i * 0x010101u;
      continue;
    }
    for (std::uint32_t channel = 0; channel < 3; ++channel) {
      const std::size_t at = 6 * i + 2 * channel;
      const std::uint32_t value = 16 * digit(kTables[number][at]) + digit(kTables[number][at + 1]);
      colors[i] |= value << 8 * channel;
    }
  }
  return colors;
}

}  // namespace isowave::core
