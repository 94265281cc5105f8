"""Blocks of a coarser level that a surface passes through: the largest difference from the finest level, of all their voxels, and of those in cells that the isovalue crosses."""
import sys, numpy as np, isowave
for arg in sys.argv[1:]:
  name,iso=arg.split(','); iso=float(iso)
  a=np.asarray(isowave.open(name).decode()).astype(np.float32)
  full=a; 
  cells=None
  def up(c,shape):
    for ax in range(3):
      n=shape[ax]; pos=(np.arange(n)-0.5)/2; lo=np.clip(np.floor(pos).astype(int),0,c.shape[ax]-1); hi=np.clip(lo+1,0,c.shape[ax]-1); w=np.clip(pos-lo,0,1).astype(np.float32)
      sh=[1,1,1]; sh[ax]=n; w=w.reshape(sh); c=np.take(c,lo,ax)*(1-w)+np.take(c,hi,ax)*w
    return c
  def down(v):
    z,y,x=[-(-s//2)*2 for s in v.shape]; v=np.pad(v,[(0,z-v.shape[0]),(0,y-v.shape[1]),(0,x-v.shape[2])],mode='edge')
    return v.reshape(z//2,2,y//2,2,x//2,2).mean((1,3,5))
  inside=a>=iso; c=np.zeros([s-1 for s in a.shape],np.int8)
  for k in range(8): c+=inside[tuple(slice(b,s-1+b) for b,s in zip(((k>>2)&1,(k>>1)&1,k&1),a.shape))]
  cross=(c>0)&(c<8); touch=np.zeros(a.shape,bool)
  for k in range(8): touch[tuple(slice(b,s-1+b) for b,s in zip(((k>>2)&1,(k>>1)&1,k&1),a.shape))]|=cross
  v=a; shapes=[a.shape]
  for level in (1,2):
    v=down(v); shapes.append(v.shape); r=v
    for s in reversed(shapes[:-1]): r=up(r,s)
    d=np.abs(r-a); n=4*2**level
    z,y,x=[-(-s//n)*n for s in a.shape]
    def blockmax(q):
      p=np.zeros((z,y,x),q.dtype); p[:a.shape[0],:a.shape[1],:a.shape[2]]=q
      return p.reshape(z//n,n,y//n,n,x//n,n).max((1,3,5))
    worst=blockmax(d); near=blockmax(np.where(touch,d,0)); t=blockmax(touch.astype(np.uint8))>0
    own=d[touch]
    print(f'{name.split("/")[-1][:24]} iso {iso:g} level {level}: of {t.sum()} blocks, largest difference in a block, median: all voxels {np.median(worst[t]):.1f}, at the surface {np.median(near[t]):.1f}; a voxel at the surface, median {np.median(own):.1f}; range of values {a.max()-a.min():g}',flush=True)
